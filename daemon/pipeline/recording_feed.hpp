// SPDX-License-Identifier: Apache-2.0
// Records the frames that tracking takes, so that a scan can be computed again from exactly the
// same data.
#pragma once

#include <exception>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <thread>

#include "daemon/loop/bounded_queue.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "drivers/replay/tum_writer.hpp"

namespace plumb {

/// Passes on another feed's frames and writes each to the disk on its own thread, without loss
/// (PNG, depth in millimetres as live sensors measure it). If the disk is late, Next() waits, and
/// the live feed before it drops and counts.
class RecordingFeed : public FrameFeed {
 public:
  /// Both borrowed. @throws IoError
  RecordingFeed(FrameFeed& feed, const StreamInfo& info, const std::filesystem::path& folder);
  ~RecordingFeed() override;

  /// @throws IoError if the recording cannot be written.
  std::optional<Frame> Next(const std::stop_token& stop) override;
  int TakeDropped() override { return feed_.TakeDropped(); }
  /// No more frames follow; waiting ones are written while the scan is computed.
  void Finish() override;
  /// Waits for the last of them, once, after Finish(). A stop request leaves an incomplete
  /// recording, as the destructor does.
  /// @throws IoError if the recording could not be written.
  void Complete(const std::stop_token& stop);
  [[nodiscard]] std::optional<double> last_frame_s() const override { return feed_.last_frame_s(); }
  [[nodiscard]] std::optional<double> taken_arrived_s() const override {
    return feed_.taken_arrived_s();
  }

 private:
  void Write(const std::stop_token& stop);

  FrameFeed& feed_;
  TumWriterOptions options_;
  TumWriter writer_;
  BoundedQueue<Frame> queue_;
  std::exception_ptr error_;
  std::jthread thread_;  // last: starts when the members above are initialised
};

}  // namespace plumb
