//! Materials of surfaces and their semantic classes.

use glam::Vec3;

use spikelane::unstable::variant_names;

/// The procedural materials. The texture modules evaluate the materials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Material {
    /// The main road. Texture coordinates are (s, d).
    Road,
    /// A side street. Texture coordinates are the distance along the center line and the offset from the center line.
    SideRoad { half_width_m: f32 },
    /// Paved sidewalk.
    Sidewalk,
    /// Curb stones.
    Curb,
    /// Lawn.
    Grass,
    /// The ground below all other surfaces.
    GroundPlane,
    /// A wall with windows. The number is an index into the facade styles of the scene.
    Facade(u16),
    /// A roof of tiles or felt with a tint between 0 and 1.
    Roof(f32),
    /// A surface of one color.
    Plain(Vec3),
    /// Tree trunk.
    Bark,
    /// Foliage with a tint between 0 and 1.
    Leaves(f32),
    /// Gray galvanized metal.
    Metal,
    /// The luminous face of the street lamp with this number.
    LampGlass(u16),
    /// A traffic sign. The number is the kind of the sign. Both texture coordinates are between -1 and 1.
    Sign(u8),
    /// The face of a traffic light. The number is the index of the lit lamp. Texture coordinates are -1 to 1
    /// horizontally and -3 to 3 vertically.
    Signal(u8),
    /// The lining of the tunnel. Texture coordinates are s and the length along the cross section.
    Tunnel,
    /// A lamp on the ceiling of the tunnel.
    TunnelLamp,
    /// An awning of a shop, with this color.
    Awning(Vec3),
    /// The shell of a vehicle. The pattern depends on the vehicle coordinates.
    Body,
    /// A window of a vehicle.
    Glass,
    /// Dark rubber and plastic.
    RubberTrim,
    /// The cargo box of a truck.
    Cargo,
    /// A tire and its rim. Texture coordinates are in units of the wheel radius.
    Wheel,
}

/// Classes of the semantic map. The numbers are the train ids of Cityscapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum Semantic {
    /// Roadway with its markings.
    Road = 0,
    /// Sidewalks and curbs.
    Sidewalk = 1,
    /// Buildings and all objects that are fixed to buildings.
    Building = 2,
    /// The lining of the tunnel.
    Wall = 3,
    /// Poles and lamps.
    Pole = 5,
    /// Traffic lights.
    TrafficLight = 6,
    /// Traffic signs.
    TrafficSign = 7,
    /// Trees and hedges.
    Vegetation = 8,
    /// Lawn and open ground.
    Terrain = 9,
    /// The sky.
    Sky = 10,
    /// Sedans and vans.
    Car = 13,
    /// Trucks.
    Truck = 14,
    /// Buses.
    Bus = 15,
}

variant_names!(Semantic {
    Road = "road", Sidewalk = "sidewalk", Building = "building", Wall = "wall", Pole = "pole",
    TrafficLight = "traffic light", TrafficSign = "traffic sign", Vegetation = "vegetation",
    Terrain = "terrain", Sky = "sky", Car = "car", Truck = "truck", Bus = "bus",
});

impl Semantic {
    /// Returns the color that Cityscapes assigns to the class.
    #[must_use]
    pub const fn color(self) -> [u8; 3] {
        match self {
            Self::Road => [128, 64, 128],
            Self::Sidewalk => [244, 35, 232],
            Self::Building => [70, 70, 70],
            Self::Wall => [102, 102, 156],
            Self::Pole => [153, 153, 153],
            Self::TrafficLight => [250, 170, 30],
            Self::TrafficSign => [220, 220, 0],
            Self::Vegetation => [107, 142, 35],
            Self::Terrain => [152, 251, 152],
            Self::Sky => [70, 130, 180],
            Self::Car => [0, 0, 142],
            Self::Truck => [0, 0, 70],
            Self::Bus => [0, 60, 100],
        }
    }
}

impl Material {
    /// Returns whether both sides of a surface with this material are visible.
    pub(crate) fn is_double_sided(self) -> bool {
        matches!(self, Self::Leaves(_) | Self::Sign(_) | Self::Awning(_))
    }

    /// Returns the class of a static surface. For vehicles, use `VehicleClass::semantic`.
    pub(crate) const fn semantic(self) -> Semantic {
        match self {
            Self::Road | Self::SideRoad { .. } => Semantic::Road,
            Self::Sidewalk | Self::Curb => Semantic::Sidewalk,
            Self::Facade(_) | Self::Roof(_) | Self::Plain(_) | Self::Awning(_) => Semantic::Building,
            Self::Bark | Self::Leaves(_) => Semantic::Vegetation,
            Self::Grass | Self::GroundPlane => Semantic::Terrain,
            Self::Metal | Self::LampGlass(_) => Semantic::Pole,
            Self::Sign(_) => Semantic::TrafficSign,
            Self::Signal(_) => Semantic::TrafficLight,
            Self::Tunnel | Self::TunnelLamp => Semantic::Wall,
            Self::Body | Self::Glass | Self::RubberTrim | Self::Cargo | Self::Wheel => Semantic::Car,
        }
    }
}
