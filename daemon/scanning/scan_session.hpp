// SPDX-License-Identifier: Apache-2.0
// One scan from its first live frame to the stored result: the tracking thread and its reports.
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
#include <vector>

#include "algo/base/message.hpp"
#include "algo/comparison/comparison.hpp"
#include "algo/comparison/marker_check.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "daemon/imports/imported_room.hpp"
#include "daemon/pipeline/live_feed.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/records/check_json.hpp"
#include "daemon/result/result_folder.hpp"
#include "daemon/result/stored_result.hpp"
#include "daemon/scanning/unit_profile.hpp"
#include "daemon/sweep/forming_answer.hpp"
#include "daemon/sweep/live_surface.hpp"
#include "daemon/sweep/sweep_guidance.hpp"

namespace plumb {

/// A scan of the room's markers, not of a patient.
struct CheckJob {
  std::optional<MarkerBaseline> baseline;
  MarkerCheckLimits limits;
};

/// The signed calibration of the room. If there is one, no other axes are used.
struct RoomAxes {
  int version = 0;
  MarkerMap markers_iec;
  Message why_not;                    ///< Why it is not used at present; empty if it is.
  double u95_m = 0.0, u95_rad = 0.0;  ///< RoomFit::U95_m() and U95_rad().
  /// Why it is too old to join what shares no marker with the scan; empty if it is not.
  Message too_old = {};
};

/// Purpose and input of a scan.
struct ScanJob {
  StreamInfo info;  ///< From the sensor.
  ReconstructorOptions reconstructor;
  CompareOptions compare;
  /// Not set: `compare` states the orientation of the room, or it is unknown.
  std::optional<RoomAxes> room;
  GuidanceOptions guidance;
  std::filesystem::path reference_scene;  ///< Scene folder to compare with; empty if there is none.
  /// Why the reference differs from the approved one; empty if it does not. Called before it is
  /// read.
  std::function<Message(const std::stop_token&)> check_reference;
  /// The room of another unit in which the reference was scanned; nothing: it was this one. Called
  /// as check_reference; may be empty.
  std::function<std::optional<ImportedRoom>()> reference_room;
  bool is_reference =
      false;  ///< The scene must be usable as a reference; otherwise there is no answer.
  /// If set, the scan is a daily check, of which only the numbers are kept.
  std::optional<CheckJob> check;
  std::shared_ptr<UnitProfile> unit_profile;  ///< Null: no profile of the sensor is used or kept.
  bool keep_recording = false;
  std::size_t queue_capacity = 15;  ///< Frames that may wait for tracking: half a second.
  double stop_after_s = 10.0;  ///< Time without new coverage after which the sweep is complete.
};

/// A reference that differs from the approved one gives no verdict: throws why.
/// @param check  See ScanJob::check_reference.
[[nodiscard]] Scene ReadApprovedScene(const std::filesystem::path& folder,
                                      const std::function<Message(const std::stop_token&)>& check,
                                      const std::stop_token& stop);

/// Puts the room's axes in the reference scene's frame, by the room's markers that it contains. A
/// reference from a planning CT has none and lies in those axes: the markers are handed on.
[[nodiscard]] std::optional<ResultRoom> TakeRoom(const std::optional<RoomAxes>& room,
                                                 const Scene& reference, CompareOptions& compare);

/// Has a reference of another unit compared in the axes of both rooms, which takes a signed
/// calibration of each. What `compare` states of the lasers of this room counts for both.
[[nodiscard]] std::optional<ResultRoom> TakeOtherRoom(const ImportedRoom& elsewhere,
                                                      const std::optional<RoomAxes>& here,
                                                      CompareOptions& compare);

/// Progress of the scan for the light, the page and `watch`.
struct ScanUpdate {
  Message step;  ///< "tracking", then the steps of the reconstruction, "comparing", "saving".
  double fraction = 0.0;  ///< Completed fraction of this step.
  std::int64_t frames = 0;
  std::int64_t frames_tracked = 0;
  std::int64_t frames_dropped = 0;
  std::int64_t keyframes = 0;
  SweepGuidance guidance;
  std::shared_ptr<const LiveSurfaceView> surface;  ///< Null: nothing can be shown yet.
  std::optional<FormingAnswer> forming;            ///< Of a comparison, once there was one.
};

/// How the scan ended, and its results. The store keeps the former as a ScanOutcome.
struct EndedScan {
  enum class Kind { kDone, kNoScene, kCancelled, kFailed };
  Kind kind = Kind::kFailed;
  Message reason;           ///< kNoScene: why the frames give no scene. kFailed: the error.
  std::string result_json;  ///< kDone with a reference: the text of result.json, for the store.
  std::vector<Message> reasons;                ///< kDone with a reference: those of the verdict.
  std::optional<StoredCorrection> correction;  ///< kDone with a reference that gave numbers.
  std::optional<TakenCheck> check;             ///< kDone or kNoScene of a daily check.
  std::optional<Verdict> verdict;  ///< For a check: in tolerance if it passed, otherwise no answer.
  std::int64_t frames = 0, frames_tracked = 0, frames_dropped = 0;
  double swept_area_m2 = 0.0;
  Message drift;  ///< That the sensor contradicts its profile; empty if it does not.
  /// Why the profile does not learn from this scan; empty if it does.
  Message why_not_learned;
  double after_last_frame_s = 0.0;  ///< Time until everything was written.
};

/// Called on the tracking thread. `begin` and `save` use the store and may throw, which fails the
/// scan; the others post to the loop.
struct ScanCallbacks {
  /// Called first: returns the folder for `scene`, `result` and `recording`.
  std::function<std::filesystem::path()> begin;
  /// Stores any outcome, and the contents of the folder. If it fails for a completed scan, it is
  /// called again for the failed one.
  std::function<void(const EndedScan&)> save;
  std::function<void(const ScanUpdate&)> update;
  /// Called once, when there was no new coverage for long enough.
  std::function<void()> sweep_complete;
  std::function<void(const EndedScan&)> ended;  ///< Called last, exactly once.
};

/// The scan starts with construction. The sensor thread pushes into feed(); closing the feed ends
/// the sweep. The owner's functions must be called from one thread (the loop's). The destructor
/// cancels and waits.
class ScanSession {
 public:
  ScanSession(ScanJob job, ScanCallbacks callbacks);
  ~ScanSession();
  ScanSession(const ScanSession&) = delete;
  ScanSession& operator=(const ScanSession&) = delete;

  [[nodiscard]] const std::shared_ptr<LiveFeed>& feed() const { return feed_; }
  /// Discards the scan; `ended` follows with kCancelled, mostly within 100 ms. Does not block.
  void Cancel();
  /// Steady time in seconds of the tracking thread's last progress. While it waits for a frame,
  /// that is the arrival of the last one.
  [[nodiscard]] double heartbeat_s() const { return heartbeat_s_; }

 private:
  void Run(const std::stop_token& stop);
  void Scan(const std::stop_token& stop);
  void Save();
  [[nodiscard]] Scene Track(const std::stop_token& stop);
  void Check(const Scene& scene);
  void Evaluate(const Scene& scene, const std::stop_token& stop);
  void OnProgress(const ScanProgress& progress);
  void Show(const Frame& frame, const TrackingReport& report);
  void FormAnswer(const ScanProgress& progress);
  [[nodiscard]] Comparison CompareWith(const Scene& reference, const Scene& scene,
                                       const std::stop_token& stop,
                                       std::optional<ResultRoom>& room) const;
  void ReportProgress(Message step, double fraction);

  ScanJob job_;
  ScanCallbacks callbacks_;
  std::filesystem::path folder_;
  std::shared_ptr<LiveFeed> feed_;
  /// The reference of the comparison, and the cells of the live surface that have to be seen.
  struct Reference {
    Scene scene;
    std::vector<std::uint8_t> region;
  };

  std::shared_future<Reference> reference_;  ///< Used by the thread; valid if there is a reference.
  SweepGuide guide_;
  LiveSurface surface_;
  ScanUpdate update_;
  EndedScan outcome_;
  bool complete_reported_ = false;
  double reported_s_ = 0.0, shown_s_ = 0.0, formed_s_ = 0.0;
  bool is_late_ = false;  ///< Tracking needs all the processor time: no more answers form.
  std::optional<FormingAnswers> forming_;  ///< While frames come, of a scan that is compared.
  std::atomic<double> heartbeat_s_;
  std::jthread thread_;  // last: starts when the members above are initialised
};

}  // namespace plumb
