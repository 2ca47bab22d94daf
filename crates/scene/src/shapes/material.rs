//! What surfaces are made of, and which class they count as.

use glam::Vec3;

/// A closed list of procedural materials; the texture files evaluate them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Material {
    /// The driving road; coordinates are (s, d).
    Road,
    /// A side street; coordinates are (distance, offset) from its centre, with its half width.
    SideRoad { half_m: f32 },
    /// Paved footway.
    Pavement,
    /// Kerb stones.
    Kerb,
    /// Lawn.
    Grass,
    /// The ground below everything.
    Base,
    /// A wall with windows; an index into the scene's facade styles.
    Facade(u16),
    /// A tiled or felted roof with a tint in 0..1.
    Roof(f32),
    /// One colour.
    Plain(Vec3),
    /// Tree trunk.
    Bark,
    /// Foliage with a tint in 0..1.
    Leaves(f32),
    /// Grey galvanised metal.
    Metal,
    /// The glowing part of street lamp `index`.
    LampGlass(u16),
    /// A traffic sign of some kind; coordinates in -1..1.
    Sign(u8),
    /// A traffic light's face; coordinates in (-1..1, -3..3), which lamp is lit.
    Signal(u8),
    /// The lining of the tunnel; coordinates are (s, height).
    Tunnel,
    /// The lamps along its ceiling.
    TunnelLamp,
    /// A shop's awning; colour.
    Awning(Vec3),
    /// A vehicle's shell; patterns follow from the vehicle's own coordinates.
    Body,
    /// A vehicle's panes.
    Glass,
    /// Dark rubber and plastic.
    Trim,
    /// A vehicle's cargo box.
    Cargo,
    /// Tyre and rim; coordinates are in units of the radius.
    Wheel,
}

/// The classes of the semantic map. Numbers 0 to 10 and 13 to 15 that
/// Cityscapes has too keep its "train ids".
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum Semantic {
    /// Carriageway, its paint included.
    Road = 0,
    /// Footways and kerbs.
    Sidewalk = 1,
    /// Buildings with everything fixed to them.
    Building = 2,
    /// The tunnel's lining (Cityscapes has "wall" here).
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
    /// Lorries.
    Truck = 14,
    /// Buses.
    Bus = 15,
}

impl Semantic {
    /// Every class, ascending by number.
    pub const ALL: [Self; 13] = [
        Self::Road,
        Self::Sidewalk,
        Self::Building,
        Self::Wall,
        Self::Pole,
        Self::TrafficLight,
        Self::TrafficSign,
        Self::Vegetation,
        Self::Terrain,
        Self::Sky,
        Self::Car,
        Self::Truck,
        Self::Bus,
    ];

    /// The class's name in lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Road => "road",
            Self::Sidewalk => "sidewalk",
            Self::Building => "building",
            Self::Wall => "wall",
            Self::Pole => "pole",
            Self::TrafficLight => "traffic light",
            Self::TrafficSign => "traffic sign",
            Self::Vegetation => "vegetation",
            Self::Terrain => "terrain",
            Self::Sky => "sky",
            Self::Car => "car",
            Self::Truck => "truck",
            Self::Bus => "bus",
        }
    }

    /// The colour that Cityscapes paints the class with.
    #[must_use]
    pub const fn colour(self) -> [u8; 3] {
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
    /// Seen from both sides.
    pub(crate) fn double_sided(self) -> bool {
        matches!(self, Self::Leaves(_) | Self::Sign(_) | Self::Awning(_))
    }

    /// The class of a static surface; a vehicle's class comes from the vehicle.
    pub(crate) const fn semantic(self) -> Semantic {
        match self {
            Self::Road | Self::SideRoad { .. } => Semantic::Road,
            Self::Pavement | Self::Kerb => Semantic::Sidewalk,
            Self::Facade(_) | Self::Roof(_) | Self::Plain(_) | Self::Awning(_) => Semantic::Building,
            Self::Bark | Self::Leaves(_) => Semantic::Vegetation,
            Self::Grass | Self::Base => Semantic::Terrain,
            Self::Metal | Self::LampGlass(_) => Semantic::Pole,
            Self::Sign(_) => Semantic::TrafficSign,
            Self::Signal(_) => Semantic::TrafficLight,
            Self::Tunnel | Self::TunnelLamp => Semantic::Wall,
            Self::Body | Self::Glass | Self::Trim | Self::Cargo | Self::Wheel => Semantic::Car,
        }
    }
}
