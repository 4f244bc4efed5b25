#include "daemon/recording_feed.hpp"

#include <utility>

namespace plumb {
namespace {

constexpr std::size_t kWaiting = 60;  // two seconds of a sensor, 130 MB

}  // namespace

RecordingFeed::RecordingFeed(FrameFeed& feed, const StreamInfo& info, const std::filesystem::path& folder)
    : feed_(feed), options_{.depth_scale = 1000.0, .jpeg_quality = 0}, writer_(folder, info, options_), queue_(kWaiting), thread_([this] {
        Write();
      }) {}

RecordingFeed::~RecordingFeed() { queue_.Close(); }

std::optional<Frame> RecordingFeed::Next(const std::stop_token& stop) {
  std::optional<Frame> frame = feed_.Next(stop);
  if (frame) (void)queue_.Push(*frame, stop);
  return frame;
}

void RecordingFeed::Write() {
  try {
    while (const std::optional<Frame> frame = queue_.Pop()) writer_.Add(EncodeFrame(*frame, options_));
    writer_.Finish();
  } catch (...) {
    error_ = std::current_exception();
    queue_.Close();
  }
}

void RecordingFeed::Finish() {
  queue_.Close();
  if (thread_.joinable()) thread_.join();
  feed_.Finish();
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

}  // namespace plumb
