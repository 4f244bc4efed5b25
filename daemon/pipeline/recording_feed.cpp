// SPDX-License-Identifier: Apache-2.0
#include "daemon/pipeline/recording_feed.hpp"

#include <utility>

namespace plumb {
namespace {

constexpr std::size_t kWaiting = 60;  // two seconds of a sensor, 130 MB

}  // namespace

RecordingFeed::RecordingFeed(FrameFeed& feed, const StreamInfo& info,
                             const std::filesystem::path& folder)
    : feed_(feed),
      options_{.depth_scale = 1000.0, .jpeg_quality = 0},
      writer_(folder, info, options_),
      queue_(kWaiting),
      thread_([this](const std::stop_token& stop) { Write(stop); }) {}

// An unfinished recording is discarded; waiting frames are not written.
RecordingFeed::~RecordingFeed() = default;

std::optional<Frame> RecordingFeed::Next(const std::stop_token& stop) {
  std::optional<Frame> frame = feed_.Next(stop);
  if (frame && !queue_.Push(*frame, stop) && !stop.stop_requested())
    Complete(stop);  // closed by an error, so continuing is useless
  return frame;
}

void RecordingFeed::Write(const std::stop_token& stop) {
  try {
    while (const std::optional<Frame> frame = queue_.Pop(stop))
      writer_.Add(EncodeFrame(*frame, options_));
    if (!stop.stop_requested()) writer_.Finish();
  } catch (...) {
    error_ = std::current_exception();
    queue_.Close();
  }
}

void RecordingFeed::Finish() {
  queue_.Close();
  feed_.Finish();
}

void RecordingFeed::Complete(const std::stop_token& stop) {
  {
    const std::stop_callback discard(stop, [this] { thread_.request_stop(); });
    thread_.join();
  }
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

}  // namespace plumb
