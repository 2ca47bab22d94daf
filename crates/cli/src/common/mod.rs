//! Code that several commands share: flags, progress and output.

mod animation;
mod camera;
pub(super) mod console;
mod flags;
mod images;
pub(super) mod limits;
mod movie;
mod outputs;
pub(super) mod progress;
mod standard_streams;
mod stream;
mod text_table;
mod video;

pub(super) use camera::{CameraArgs, CameraChanges, exact_rate};
pub(super) use console::{Console, command_line, event, recorded_command, recorded_path, run_record};
pub(super) use flags::{
    CropArg, LightingArg, ReadoutRange, SceneSeed, SeedArgs, StreamMosaicArgs, ThreadArgs, detection_note,
    parse_mosaic,
};
pub(super) use images::{
    PictureFormat, contact_sheet, encode_png, gray_image, picture_levels, sample_readouts, spikes_picture,
    white_rate,
};
pub(super) use movie::{MOVIE_EXTENSIONS, MovieFormat, MovieWriter};
pub(super) use outputs::{
    OutputNames, OutputStem, ReportFiles, append_ending, claim_files, claim_folder, replace_between_markers,
};
pub(super) use progress::{CountProgress, FileProgress, StopSignal, run_interruptible, stop_flag};
pub(super) use standard_streams::{StreamOutput, is_dash, refuse_dash, refuse_json};
pub(super) use stream::{
    OpenedStream, StreamArgs, count_spikes, file_name, parse_size, print_set_warnings, sidecar_beside,
};
pub(super) use text_table::{marked, smallest, sparkline, text_table};
pub(super) use video::{FrameEncoding, VideoWriter};
