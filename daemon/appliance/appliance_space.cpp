// SPDX-License-Identifier: Apache-2.0
// Room for the next scan on the disks of the stored data.
#include <algorithm>
#include <cmath>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/loop/log.hpp"
#include "words/upkeep.hpp"

namespace plumb {

/// Upper limit for the space of the next scan.
std::uint64_t Appliance::NeededBytes() const {
  // Measured: a compared scan of 640x480 takes 40 MB; a recording takes 2.35 bytes per pixel and
  // frame.
  constexpr double kScene = 16e6, kSceneOfPixel = 110.0, kFrameOfPixel = 2.6, kFramesPerSecond = 30;
  const Intrinsics camera = sensors_.snapshot().info.intrinsics;
  const double pixels = std::max(320.0 * 240.0, static_cast<double>(camera.width) * camera.height);
  const Settings settings = store_ ? store_->settings.Get() : Settings{};
  double bytes = kScene + kSceneOfPixel * pixels;
  if (!session_.check() && settings.keep_recordings) {
    const double sweep_s = settings.scan_limit_s;
    bytes += kFrameOfPixel * pixels * kFramesPerSecond * sweep_s;
  }
  return static_cast<std::uint64_t>(bytes);
}

/// Why the disk has no room for a scan; empty if it has. @throws IoError if the settings cannot be
/// read
Appliance::Answer Appliance::WhyFull() const {
  const auto space = storage_.SpaceForScans();
  if (!space) return {};  // a disk that cannot be examined is reported elsewhere
  const std::uint64_t needed = NeededBytes();
  if (space->available >= needed) return {};
  const auto whole_mb = [](std::uintmax_t bytes) {
    return std::floor(static_cast<double>(bytes) / 1e6);
  };
  return say::upkeep::DiskFull(whole_mb(space->available), whole_mb(needed));
}

/// Why no scan can be stored now; empty if one can.
Appliance::Answer Appliance::WhyNoSpace() const {
  try {
    return WhyFull();
  } catch (const std::exception& failure) {
    return say::upkeep::NoScanCanBegin(MessageOf(failure));
  }
}

/// State and light must not say "ready" while each press is refused. A result, or the failure of a
/// scan, stays until it has been seen; monitoring needs no room.
void Appliance::WatchSpace() {
  if (IsRunning() || state_.phase == ApplianceState::kResult ||
      state_.phase == ApplianceState::kMonitoring || state_.fault == FaultKind::kScan ||
      !storage_.fault().empty())
    return;
  Answer why;
  try {
    why = WhyFull();
  } catch (const std::exception&) {
    return;  // the status reads the same settings and reports the failure
  }
  const bool has_changed = why.empty() != space_fault_.empty();
  space_fault_ = why;
  if (has_changed) {
    Log(why.empty() ? LogLevel::kNotice : LogLevel::kError,
        why.empty() ? "there is room for scans again" : why.English());
    (void)Handle(why.empty() ? ScanEvent::kStorageWorks : ScanEvent::kStorageFailed);
  }
  if (Pattern() == shown_) return;  // the disk may have become nearly full
  Show();
  notices_.TellPage(web::EventKind::kStatus);
}

}  // namespace plumb
