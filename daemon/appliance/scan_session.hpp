// One scan, from its first live frame to what is stored: the tracking thread and what it reports.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "algo/comparison/comparison.hpp"
#include "algo/comparison/marker_check.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "daemon/appliance/live_surface.hpp"
#include "daemon/appliance/sweep_guidance.hpp"
#include "daemon/appliance/unit_profile.hpp"
#include "daemon/pipeline/live_feed.hpp"

namespace plumb {

/// A scan of the room's markers, not of a patient.
struct CheckJob {
  std::optional<MarkerBaseline> baseline;
  MarkerCheckLimits limits;
};

/// The signed calibration of the room. Where one is, no other axes are taken.
struct RoomAxes {
  int version = 0;
  MarkerMap markers_iec;
  std::string why_not;  ///< Why it is not to be used now; empty: it is.
};

/// What a scan is made for.
struct ScanJob {
  StreamInfo info;  ///< Of the sensor.
  ReconstructorOptions reconstructor;
  CompareOptions compare;
  std::optional<RoomAxes> room;  ///< None: `compare` says where the room lies, or nobody knows.
  GuidanceOptions guidance;
  std::filesystem::path reference_scene;  ///< SCENE to compare with; empty: none.
  /// Why the reference is not what was approved; empty: it is. Asked before it is read.
  std::function<std::string(const std::stop_token&)> check_reference;
  bool is_reference =
      false;  ///< The scene must be one that others can be compared with, else there is no answer.
  std::optional<CheckJob> check;  ///< Set: the daily check; nothing but its numbers is kept.
  std::shared_ptr<UnitProfile> unit_profile;  ///< Null: nothing is known of the sensor, nor kept.
  bool keep_recording = false;
  std::size_t queue_capacity = 15;  ///< Frames that may wait for tracking: half a second.
  double stop_after_s = 10.0;       ///< Without new coverage: the sweep is complete.
};

/// How far it is; for the light, the page and `watch`.
struct ScanUpdate {
  std::string step;  ///< "tracking", then what the reconstruction names, "comparing", "saving".
  double fraction = 0.0;  ///< Of this step.
  std::int64_t frames = 0;
  std::int64_t frames_tracked = 0;
  std::int64_t frames_dropped = 0;
  std::int64_t keyframes = 0;
  SweepGuidance guidance;
  std::shared_ptr<const LiveSurfaceView> surface;  ///< Null: nothing can be shown yet.
};

/// How it ended.
struct ScanOutcome {
  enum class Kind { kDone, kNoScene, kCancelled, kFailed };
  Kind kind = Kind::kFailed;
  std::string reason;              ///< kNoScene: why the frames make no scene. kFailed: what broke.
  std::string result_json;         ///< kDone with a reference: as result.json.
  std::string check_json;          ///< kDone or kNoScene of a check: as CheckJson().
  std::optional<Verdict> verdict;  ///< Of a check: in tolerance where it passed, else no answer.
  std::int64_t frames = 0, frames_tracked = 0, frames_dropped = 0;
  double swept_area_m2 = 0.0;
  std::string drift;                ///< That the sensor contradicts its profile; empty: no.
  std::string teaches_nothing;      ///< Why nothing was learned of the sensor; empty: it may be.
  double after_last_frame_s = 0.0;  ///< Until everything was written.
};

/// Called on the tracking thread. `begin` and `save` use the store and may throw, which fails the
/// scan; the others post to the loop.
struct ScanCallbacks {
  /// First: gives the folder in which `scene`, `result` and `recording` are written.
  std::function<std::filesystem::path()> begin;
  /// Stores the outcome, whatever it is, and what the folder holds. If that of a scan that is done
  /// fails, it is called again for the failed one.
  std::function<void(const ScanOutcome&)> save;
  std::function<void(const ScanUpdate&)> update;
  std::function<void()> sweep_complete;           ///< No new coverage for long enough; once.
  std::function<void(const ScanOutcome&)> ended;  ///< Last; exactly once.
};

/// Starts with its construction. The sensor thread pushes into feed(); closing the feed ends the
/// sweep. The owner's functions are called from one thread (the loop's); the destructor cancels and
/// waits.
class ScanSession {
 public:
  ScanSession(ScanJob job, ScanCallbacks callbacks);
  ~ScanSession();
  ScanSession(const ScanSession&) = delete;
  ScanSession& operator=(const ScanSession&) = delete;

  [[nodiscard]] const std::shared_ptr<LiveFeed>& feed() const { return feed_; }
  /// Discards the scan; `ended` follows with kCancelled, mostly within 100 ms. Does not wait.
  void Cancel();
  /// Steady seconds at which the tracking thread last got on. While it waits for a frame that is
  /// the last one's arrival.
  [[nodiscard]] double heartbeat_s() const { return heartbeat_s_; }

 private:
  void Run(const std::stop_token& stop);
  void Scan(const std::stop_token& stop);
  void Save();
  [[nodiscard]] Scene Track(const std::stop_token& stop);
  void Check(const Scene& scene);
  void Evaluate(const Scene& scene, const std::stop_token& stop);
  void OnProgress(const struct ScanProgress& progress);
  void Show(const Frame& frame, const TrackingReport& report);
  void ReportProgress(std::string step, double fraction);

  ScanJob job_;
  ScanCallbacks callbacks_;
  std::filesystem::path folder_;
  std::shared_ptr<LiveFeed> feed_;
  /// What the sweep is compared with, and which cells of the live surface it has to see.
  struct Reference {
    Scene scene;
    std::vector<std::uint8_t> region;
  };

  std::shared_future<Reference>
      reference_;  ///< Belongs to the thread; valid if there is one to compare with.
  SweepGuide guide_;
  LiveSurface surface_;
  ScanUpdate update_;
  ScanOutcome outcome_;
  bool told_complete_ = false;
  double told_s_ = 0.0, shown_s_ = 0.0;
  std::atomic<double> heartbeat_s_;
  std::jthread thread_;  // last: starts when everything above is there
};

}  // namespace plumb
