//! The answers to requests.

use std::sync::Arc;

use serde_json::{Value, json};
use spikelane::error::{ErrorKind, Result, bail, error, render_settings};

use crate::encoding::encoded_image;
use crate::http::{REPORT_POLICY, Response};
use crate::jobs::{JobState, Jobs, Task};
use crate::live::LiveState;
use crate::picture::{MAX_WINDOW_READOUTS, Method};
use crate::query::Query;
use crate::region::{MAX_REQUEST_BYTES, check_request, interval_distances, pixel, rate_over_time};
use crate::sources::{OpenStream, Sources};
use crate::{labels, page};

/// The data of a server.
pub(crate) struct Api {
    pub(crate) sources: Sources,
    pub(crate) jobs: Jobs,
}

impl Api {
    /// Returns the response to a request whose access was checked. `path` is the path after the token.
    pub(crate) fn respond(&self, path: &str, query: &str) -> Response {
        if let Some(file) = page::file(path) {
            return Response::new(file.content_type, file.bytes);
        }
        let Some(name) = path.strip_prefix("api/") else {
            return Response::text(404, "no such page");
        };
        self.answer(name, &Query(query)).unwrap_or_else(|error| {
            let status = if error.kind() == ErrorKind::Usage { 400 } else { 500 };
            Response::json(&json!({"error": error.to_string()})).with_status(status)
        })
    }

    fn answer(&self, name: &str, query: &Query) -> Result<Response> {
        Ok(match name {
            "sources" => Response::json(&self.sources.to_json()),
            "stream" => Response::json(&self.stream_json(query)?),
            "image" => {
                let stream = self.stream(query)?;
                let (at, window) = (query.get("at")?, query.get("window")?);
                let image = encoded_image(query.get("method")?, &stream.reader, at, window)?;
                Response::new("application/octet-stream", image)
            }
            "live" => self.live(query)?,
            "pixel" => {
                let stream = self.stream(query)?;
                let range = query.readouts(stream.reader.readouts())?;
                Response::json(&pixel(&stream.reader, query.get("x")?, query.get("y")?, range)?)
            }
            "region" => {
                let stream = self.stream(query)?;
                let range = query.readouts(stream.reader.readouts())?;
                check_request(&stream.reader, &range)?;
                let crop = query.crop(stream.reader.geometry())?;
                Response::json(&rate_over_time(&stream.reader, crop, range, &|_| {})?)
            }
            "distances" => {
                let streams = [self.stream(query)?, self.sources.stream(query.get("b")?)?];
                let range = query.readouts(streams[0].reader.readouts())?;
                let crop = query.crop(streams[0].reader.geometry())?;
                crop.geometry(streams[1].reader.geometry())?;
                let other = streams[1].reader.readouts();
                let start = range.start.min(other.saturating_sub(range.len()));
                let second = start..(start + range.len()).min(other);
                let readers = [&streams[0].reader, &streams[1].reader];
                Response::json(&interval_distances(readers, crop, [range, second])?)
            }
            "job" => self.job(query)?,
            "rates" => match self.jobs.state(query.stream()?, Task::Summary, self.stream(query)?)? {
                JobState::Done(done) => Response::floats(done.result().map_or(&[], |r| &r.rates)),
                _ => return Err(error!(Usage, "rate map"; found "an unfinished computation")),
            },
            "labels" => Response::json(&labels::labeled_frames(&self.sources.sequence(query.stream()?)?)?),
            "label_map" => {
                let files = self.sources.sequence(query.stream()?)?;
                let kind = query.text("kind").unwrap_or_default();
                let map = labels::label_map(&files, query.get("readout")?, kind)?;
                Response::floats(&map.values).with_header("X-Size", format!("{},{}", map.width, map.height))
            }
            "report" => {
                let bytes = self.sources.report(query.get("s")?)?;
                Response::new("text/html; charset=utf-8", bytes).with_policy(REPORT_POLICY)
            }
            _ => return Ok(Response::text(404, "no such request")),
        })
    }

    fn stream(&self, query: &Query) -> Result<Arc<OpenStream>> {
        self.sources.stream(query.stream()?)
    }

    fn stream_json(&self, query: &Query) -> Result<Value> {
        let key = query.stream()?;
        if let Some(live) = self.sources.live(key.source)? {
            let geometry = live.geometry;
            return Ok(json!({
                "width": geometry.width(), "height": geometry.height(), "readouts": 0,
                "readout_hz": live.readout_hz, "is_live": true, "max_window": MAX_WINDOW_READOUTS,
            }));
        }
        let stream = self.stream(query)?;
        let (reader, geometry) = (&stream.reader, stream.reader.geometry());
        let warnings = stream.warnings.iter().map(|text| render_settings(text, &|key| key.replace('_', " ")));
        Ok(json!({
            "width": geometry.width(), "height": geometry.height(), "readouts": reader.readouts(),
            "readout_hz": stream.readout_hz, "layout": reader.layout().name(), "warnings": warnings.collect::<Vec<_>>(),
            "missing_frames": reader.missing_frames().len(), "is_live": false, "max_window": MAX_WINDOW_READOUTS,
            "max_request_readouts": (MAX_REQUEST_BYTES / geometry.frame_bytes()).max(1),
        }))
    }

    fn live(&self, query: &Query) -> Result<Response> {
        let Some(live) = self.sources.live(query.get("s")?)? else {
            bail!(Usage, "live image"; found "a stored stream");
        };
        let (method, window): (Method, usize) = (query.get("method")?, query.get("window")?);
        // The search of a TFI image needs readouts on both sides of its center.
        let count = if method == Method::Tfi { 2 * window } else { window };
        let (frames, state) = live.latest(count.clamp(1, 2 * MAX_WINDOW_READOUTS))?;
        let center = if method == Method::Bits { frames.readouts() - 1 } else { frames.readouts() / 2 };
        let image = method.image_of_frames(frames.view(), center, window)?;
        Ok(Response::floats(&image).with_header("X-Live", live_text(&state, live.state().error.is_some())))
    }

    fn job(&self, query: &Query) -> Result<Response> {
        let stream = self.stream(query)?;
        let task = match query.text("task") {
            Some("summary") => Task::Summary,
            Some("region") => Task::Region(query.crop(stream.reader.geometry())?),
            _ => return Err(error!(Usage, "task"; expected "summary or region")),
        };
        Ok(Response::json(&match self.jobs.state(query.stream()?, task, stream)? {
            JobState::Running { share } => json!({"state": "running", "share": share}),
            JobState::Failed(error) => json!({"state": "failed", "error": error}),
            JobState::Done(done) => json!({"state": "done", "result": done.result().map(|r| &r.value)}),
        }))
    }
}

/// Returns received, latest, dropped and unread readouts, and the state.
fn live_text(state: &LiveState, has_failed: bool) -> String {
    let end = if has_failed {
        "failed"
    } else if state.has_ended {
        "ended"
    } else {
        "running"
    };
    format!("{},{},{},{},{end}", state.received, state.latest.unwrap_or(0), state.dropped, state.lag)
}
