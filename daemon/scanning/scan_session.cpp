// SPDX-License-Identifier: Apache-2.0
#include "daemon/scanning/scan_session.hpp"

#include <cmath>
#include <future>
#include <tuple>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/comparison/room_board.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/freed_memory.hpp"
#include "daemon/pipeline/frame_thinning.hpp"
#include "daemon/pipeline/learning_gate.hpp"
#include "daemon/pipeline/recording_feed.hpp"
#include "daemon/reports/text_report.hpp"
#include "daemon/result/result_folder.hpp"
#include "daemon/sweep/explain.hpp"
#include "words/reconstruction.hpp"
#include "words/room.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

constexpr double kUpdateEvery_s = 0.1;
constexpr double kShowEvery_s = 0.4;  // interval at which pages ask for the surface from above
// A sweep that took less has too few views; answers follow each other at this interval at least.
constexpr double kFormAfter_s = 2.0, kFormEvery_s = 1.0;
// With less of the region the comparison would refuse, see AcceptanceLimits::min_coverage.
constexpr double kFormFromCoverage = 0.85;

void ThrowIfStopped(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Interrupted(say::scan::Discarded());
}

}  // namespace

Scene ReadApprovedScene(const std::filesystem::path& folder,
                        const std::function<Message(const std::stop_token&)>& check,
                        const std::stop_token& stop) {
  if (check) {
    const Message fault = check(stop);
    if (!fault.empty())
      throw MessageError(say::scan::ReferenceUnusable(fault, folder.parent_path().string()));
  }
  try {
    return ReadScene(folder);
  } catch (const std::exception& error) {
    throw MessageError(say::scan::ReferenceUnreadable(MessageOf(error)));
  }
}

namespace {

/// The current scan is placed by the signed calibration. What the configuration states of the
/// lasers stays as it is: a calibration cannot know it, and its absence is warned of.
void JoinBySigned(const RoomAxes& room, CompareOptions& compare) {
  compare.T_iec_reference = Pose::Identity();
  compare.room_markers = room.markers_iec;
  compare.calibration_u95_m = room.u95_m;
  compare.calibration_u95_rad = room.u95_rad;
}

}  // namespace

std::optional<ResultRoom> TakeRoom(const std::optional<RoomAxes>& room, const Scene& reference,
                                   CompareOptions& compare) {
  if (reference.planning) compare.isocentre_m.reset();  // the origin of its frame
  if (!room) {
    if (reference.planning && !compare.T_iec_reference)
      compare.why_no_room = say::room::NoneForPlan();
    return std::nullopt;
  }
  compare.T_iec_reference.reset();
  ResultRoom used{room->version, {}};
  if (!room->why_not.empty()) {
    used.why_not_used = room->why_not;
    compare.why_no_room = say::room::NotForPlan(room->why_not);
    return used;
  }
  if (reference.planning) {
    if (!room->too_old.empty()) {
      used.why_not_used = room->too_old;
      compare.why_no_room = say::room::NotForPlan(room->too_old);
      return used;
    }
    JoinBySigned(*room, compare);
    return used;
  }
  compare.T_iec_reference = RoomOf(room->markers_iec, reference.markers);
  if (!compare.T_iec_reference) used.why_not_used = say::room::MarkersMoved();
  return used;
}

std::optional<ResultRoom> TakeOtherRoom(const ImportedRoom& elsewhere,
                                        const std::optional<RoomAxes>& here,
                                        CompareOptions& compare) {
  CalibratedRoom& theirs = compare.reference_room.emplace();
  theirs.why_not = elsewhere.why_not;
  if (elsewhere.room) {
    const RoomFit& fit = elsewhere.room->fit;
    theirs.T_iec_reference = Pose::Identity();
    theirs.u95_m = compare.iec_u95_m;
    theirs.u95_rad = compare.iec_u95_rad;
    theirs.calibration_u95_m = fit.U95_m();
    theirs.calibration_u95_rad = fit.U95_rad();
    theirs.markers = fit.markers_iec;
  }
  compare.T_iec_reference.reset();
  compare.why_no_room = !here                   ? say::room::ElsewhereNeedsCalibration()
                        : here->why_not.empty() ? here->too_old
                                                : here->why_not;
  if (!compare.why_no_room.empty()) return std::nullopt;
  JoinBySigned(*here, compare);
  return ResultRoom{here->version, {}};
}

ScanSession::ScanSession(ScanJob job, ScanCallbacks callbacks)
    : job_(std::move(job)),
      callbacks_(std::move(callbacks)),
      feed_(std::make_shared<LiveFeed>(job_.queue_capacity)),
      guide_(job_.info.intrinsics, job_.guidance),
      surface_(job_.info.intrinsics),
      heartbeat_s_(SteadySeconds()),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

ScanSession::~ScanSession() { Cancel(); }

void ScanSession::Cancel() {
  thread_.request_stop();
  feed_->Close();
}

void ScanSession::Run(const std::stop_token& stop) {
  try {
    Scan(stop);
    outcome_.kind = EndedScan::Kind::kDone;
  } catch (const Interrupted&) {
    outcome_.kind = EndedScan::Kind::kCancelled;
  } catch (const DataError& error) {
    outcome_.kind = EndedScan::Kind::kNoScene;
    outcome_.reason = error.message();
    if (job_.check) {
      MarkerCheck failed{.status = MarkerCheckStatus::kFailed, .items = {}, .reasons = {}};
      failed.reasons.push_back(error.message());
      outcome_.check = TakenCheck{std::move(failed)};
    }
  } catch (const std::bad_alloc&) {
    outcome_.kind = EndedScan::Kind::kFailed;
    outcome_.reason = say::scan::SweepOutOfMemory();
  } catch (const std::exception& error) {
    outcome_.kind = EndedScan::Kind::kFailed;
    outcome_.reason = Explain(error);
  }
  if (outcome_.kind != EndedScan::Kind::kDone && stop.stop_requested()) {
    outcome_.kind = EndedScan::Kind::kCancelled;
    outcome_.check.reset();  // one that is discarded as it fails is not a failed check
  }
  Save();
  // The profile changes only after the scan has been stored.
  if (outcome_.kind == EndedScan::Kind::kDone && job_.unit_profile &&
      outcome_.why_not_learned.empty())
    job_.unit_profile->LearnFromScan();
  callbacks_.ended(outcome_);
  ReturnFreedMemory();
}

void ScanSession::Scan(const std::stop_token& stop) {
  folder_ = callbacks_.begin();
  // Read during the sweep, because it is needed as soon as the new scene is available.
  if (!job_.reference_scene.empty()) {
    reference_ = std::async(std::launch::async, [this, stop, grid = surface_.grid()] {
                   Reference reference{
                       ReadApprovedScene(job_.reference_scene, job_.check_reference, stop), {}};
                   // The live surface lies in the sweep's frame, and a planning CT in the room's.
                   if (reference.scene.planning) return reference;
                   try {
                     reference.region =
                         RegionToSee(reference.scene, job_.compare.region_polygon_m, grid);
                   } catch (const std::exception&) {
                     // It is used for guidance only; the comparison reports errors.
                   }
                   return reference;
                 }).share();
  }
  if (job_.unit_profile) job_.unit_profile->Begin(job_.reconstructor);
  const Scene scene = Track(stop);
  if (job_.unit_profile) outcome_.drift = job_.unit_profile->Drift();
  if (job_.check) {
    Check(scene);
    outcome_.why_not_learned = WhyNotLearned(scene, outcome_.verdict, job_.compare.limits);
  } else {
    Evaluate(scene, stop);
    outcome_.why_not_learned = WhyNotLearned(scene, outcome_.verdict, job_.compare.limits);
    ThrowIfStopped(stop);  // from here on it is stored
  }
  if (const std::optional<double> last_s = feed_->last_frame_s())
    outcome_.after_last_frame_s = SteadySeconds() - *last_s;
}

void ScanSession::Save() {
  try {
    callbacks_.save(outcome_);
    return;
  } catch (const std::exception& error) {
    if (outcome_.kind == EndedScan::Kind::kDone || outcome_.reason.empty())
      outcome_.reason = MessageOf(error);
    outcome_.kind = EndedScan::Kind::kFailed;
  }
  try {
    callbacks_.save(outcome_);
  } catch (const std::exception&) {  // reported already; the next start repairs the store
  }
}

namespace {

/// The error that made the scan fail is reported, not that its images cannot be written either.
void KeepFailed(RecordingFeed& recording, const std::stop_token& stop) {
  try {
    recording.Finish();
    recording.Complete(stop);
  } catch (const std::exception&) {  // an incomplete recording is not kept
  }
}

}  // namespace

Scene ScanSession::Track(const std::stop_token& stop) {
  ThinnedFeed thinned(*feed_);
  std::optional<RecordingFeed> recording;
  if (job_.keep_recording) recording.emplace(thinned, job_.info, folder_ / "recording");
  FrameFeed& feed = recording ? static_cast<FrameFeed&>(*recording) : thinned;
  try {
    Scene scene = RunScan(feed, job_.info, job_.reconstructor, stop,
                          [this](const ScanProgress& progress) { OnProgress(progress); });
    if (recording) recording->Complete(stop);
    thinned.WarnIn(scene);
    return scene;
  } catch (...) {
    if (recording && !stop.stop_requested()) KeepFailed(*recording, stop);
    throw;
  }
}

void ScanSession::OnProgress(const ScanProgress& progress) {
  // Fail before the sweep if the reference cannot be read.
  if (reference_.valid() &&
      reference_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    const Reference& reference = reference_.get();
    if (!surface_.has_region()) surface_.SetRegion(reference.region);
  }
  heartbeat_s_ = SteadySeconds();
  update_.frames = outcome_.frames = progress.frames;
  update_.frames_tracked = outcome_.frames_tracked = progress.frames_tracked;
  update_.frames_dropped = outcome_.frames_dropped = progress.frames_dropped;
  if (progress.tracking != nullptr && progress.frame != nullptr) {
    update_.keyframes += progress.tracking->is_keyframe ? 1 : 0;
    update_.guidance = guide_.Add(*progress.frame, *progress.tracking);
    Show(*progress.frame, *progress.tracking);
    outcome_.swept_area_m2 = update_.guidance.area_m2;
    if (update_.guidance.without_new_surface_s >= job_.stop_after_s &&
        !std::exchange(complete_reported_, true))
      callbacks_.sweep_complete();
    FormAnswer(progress);
  } else if (forming_) {
    forming_->Stop();  // what follows needs the processors
  }
  ReportProgress(progress.step, progress.fraction);
}

void ScanSession::Show(const Frame& frame, const TrackingReport& report) {
  surface_.Add(frame, report);
  const double now_s = SteadySeconds();
  if (now_s - shown_s_ < kShowEvery_s) return;
  shown_s_ = now_s;
  update_.surface = surface_.View();
}

/// Begins the next answer of what was seen so far, if the last one is made, and reports that one.
void ScanSession::FormAnswer(const ScanProgress& progress) {
  if (!reference_.valid() || !progress.tracking->T_scene_world ||
      reference_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return;
  const double now_s = SteadySeconds();
  if (formed_s_ == 0.0) formed_s_ = now_s - kFormEvery_s + kFormAfter_s;
  if (!forming_) {
    forming_.emplace([this](const Scene& scene, const std::stop_token& stop) {
      std::optional<ResultRoom> room;
      return CompareWith(reference_.get().scene, scene, stop, room);
    });
  }
  // The least priority does not help where a quota limits both threads together.
  if (progress.frame->fewer_keypoints || progress.frames_dropped > 0) {
    is_late_ = true;
    forming_->Stop();
  }
  update_.forming = forming_->Newest();
  if (update_.guidance.advice == SweepAdvice::kNone && update_.forming &&
      update_.forming->is_enough)
    update_.guidance.advice = SweepAdvice::kEnough;
  const bool is_covered =
      !update_.surface || update_.surface->coverage.value_or(1.0) >= kFormFromCoverage;
  if (is_late_ || !is_covered || now_s - formed_s_ < kFormEvery_s || !forming_->IsIdle()) return;
  formed_s_ = now_s;
  forming_->Make(progress.sweep->SceneUpToNow(), update_.guidance.elapsed_s);
}

/// Reports at most ten times a second, but each new step and the first frame at once.
void ScanSession::ReportProgress(Message step, double fraction) {
  const double now_s = SteadySeconds();
  heartbeat_s_ = now_s;
  if (step == update_.step && now_s - reported_s_ < kUpdateEvery_s) return;
  reported_s_ = now_s;
  update_.step = std::move(step);
  update_.fraction = fraction;
  if (callbacks_.update) callbacks_.update(update_);
}

void ScanSession::Check(const Scene& scene) {
  ReportProgress(say::scan::Checking(), 0.0);
  // The board of the room calibration is present in this scan only: its markers do not belong to
  // the room.
  Scene room, board;
  room.room_markers = board.room_markers = scene.room_markers;
  room.calibration = scene.calibration;
  std::tie(board.markers, room.markers) =
      SplitRoomBoard(scene.markers, MarkerDictionary::ByName(scene.room_markers.dictionary).size());
  MarkerCheck check = CheckMarkers(room, job_.check->baseline, job_.check->limits);
  if (!outcome_.drift.empty()) {
    check.status = MarkerCheckStatus::kFailed;
    check.reasons.push_back(outcome_.drift);
  }
  outcome_.verdict =
      check.status == MarkerCheckStatus::kPassed ? Verdict::kInTolerance : Verdict::kNoAnswer;
  outcome_.check = TakenCheck{.check = std::move(check),
                              .seen = BaselineOf(room, job_.check->limits),
                              .board = BaselineOf(board, job_.check->limits).markers,
                              .reference_marker = scene.frame == SceneFrame::kReferenceMarker
                                                      ? scene.room_markers.reference
                                                      : std::nullopt};
}

Comparison ScanSession::CompareWith(const Scene& reference, const Scene& scene,
                                    const std::stop_token& stop,
                                    std::optional<ResultRoom>& room) const {
  CompareOptions compare = job_.compare;
  compare.stop = stop;
  std::optional<ImportedRoom> elsewhere;
  if (job_.reference_room && !reference.planning) elsewhere = job_.reference_room();
  room = elsewhere ? TakeOtherRoom(*elsewhere, job_.room, compare)
                   : TakeRoom(job_.room, reference, compare);
  try {
    Comparison comparison = Compare(reference, scene, compare);
    if (elsewhere && elsewhere->room)
      comparison.warnings.push_back(
          say::room::ReferenceElsewhere(elsewhere->unit, elsewhere->version));
    return comparison;
    // not an error of the sweep: another one would end the same way
  } catch (const DataError& error) {
    throw MessageError(say::scan::DoesNotFit(error.message()));
  }
}

void ScanSession::Evaluate(const Scene& scene, const std::stop_token& stop) {
  ThrowIfStopped(stop);
  if (job_.is_reference && (scene.frame != SceneFrame::kReferenceMarker || !scene.height_map)) {
    throw DataError(say::scan::NoReferenceMarker());
  }
  ReportProgress(say::scan::Saving(), 0.0);
  // The scene is written to the disk while it is compared.
  std::future<void> writing =
      std::async(std::launch::async, [&] { WriteScene(scene, folder_ / "scene", stop); });
  std::optional<Comparison> comparison;
  std::optional<ResultRoom> room;
  ResultPictures pictures;
  if (reference_.valid()) {
    ReportProgress(say::scan::Comparing(), 0.0);
    const Scene& reference = reference_.get().scene;
    ThrowIfStopped(stop);
    comparison = CompareWith(reference, scene, stop, room);
    ThrowIfStopped(stop);
    if (room && !room->why_not_used.empty()) {
      comparison->warnings.push_back(
          say::room::CalibrationNotUsed(room->version, room->why_not_used));
    }
    if (!outcome_.drift.empty()) comparison->warnings.push_back(outcome_.drift);
    pictures = DrawResult(*comparison, reference.height_map ? &*reference.height_map : nullptr,
                          {.tolerance_m = job_.compare.limits.shift_tolerance_m,
                           .subtitle = PictureSubtitle(*comparison)});
    ReportProgress(say::scan::Saving(), 0.5);
  }
  writing.get();
  if (!comparison) return;
  ThrowIfStopped(stop);
  WriteResult(*comparison, pictures, folder_ / "result", room);
  const StoredResult stored = Stored(*comparison, room);
  outcome_.result_json = ResultText(stored);
  outcome_.verdict = comparison->verdict;
  outcome_.reasons = comparison->reasons;
  outcome_.correction = stored.correction;
}

}  // namespace plumb
