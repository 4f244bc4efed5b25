// SPDX-License-Identifier: Apache-2.0
// The page's service for references: scans and planning CTs that later scans are compared with.
#include "daemon/services/web_services.hpp"

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/names.hpp"
#include "daemon/appliance/plan_options.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/planning/patient_hash.hpp"
#include "daemon/reports/plan_doubts.hpp"
#include "daemon/reports/scan_quality.hpp"
#include "daemon/services/arriving_planning.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

class WebReferences final : public web::ReferenceService {
 public:
  WebReferences(const ReferenceGate& references, const CurrentSession& session,
                const RoomInUse& room, StoreAccess& store, web::BackgroundWork& background,
                std::stop_token stop)
      : references_(references),
        session_(session),
        room_(room),
        store_(store),
        background_(background),
        stop_(std::move(stop)) {}

  std::vector<Reference> References(const std::string& patient_id) override {
    return store_.Read(&Store::references,
                       [&](ReferenceStore& references) { return references.List(patient_id); });
  }

  std::optional<Reference> FindReference(const std::string& id) override {
    return store_.Read(&Store::references,
                       [&](ReferenceStore& references) { return references.Find(id); });
  }

  RoomOnMap RoomOfReference(const Reference& reference) override {
    const std::optional<Scan> scan = ScanOf(reference.scan_id);
    if (!scan || scan->folder.empty()) return {};
    try {
      const Scene scene = ReadStoredScene(scan->folder / "scene").scene;
      const bool is_to_approve = reference.approved_by.empty() && !reference.planned_by.empty();
      if (scene.planning)  // its map lies in IEC axes
        return {.gantry_xy = {0, 1},
                .right_xy = {1, 0},
                .is_known = true,
                .contradicts_posture = is_to_approve && DoubtsOf(reference).posture};
      const MarkerMap& markers = scene.markers;
      const auto ways = room_.In(markers);
      if (!ways) return {};
      RoomOnMap room{.gantry_xy = {ways->gantry.x(), ways->gantry.y()},
                     .right_xy = {ways->right.x(), ways->right.y()},
                     .is_known = true};
      if (const auto lasers = room_.LasersIn(markers))
        room.lasers_m = {lasers->x(), lasers->y(), lasers->z()};
      room.contradicts_posture = is_to_approve && DoubtsOf(reference).posture;
      return room;
    } catch (const std::exception& error) {
      Log(LogLevel::kNotice,
          fmt::format("no room for reference {}: {}", reference.id, error.what()));
      return {};
    }
  }

  void AddReference(const Actor& actor, const std::string& scan_id, const std::string& reason,
                    Done done) override {
    const std::optional<Scan> scan = ScanOf(scan_id);
    if (RefuseIf(references_.WhyNot(scan), done)) return;
    const Settings settings =
        store_.Read(&Store::settings, [](SettingsStore& stored) { return stored.Get(); });
    ReferencePlan plan = DefaultPlan(settings);
    // A position that was compared with a reference is captured in the posture and with the
    // tolerance of that one. Its region and isocentre lie on another map.
    if (const auto before = scan ? FindReference(scan->reference_id) : std::nullopt) {
      plan.posture = before->plan.posture;
      plan.tolerance = before->plan.tolerance;
    }
    store_.Write(&Store::references, std::move(done), [=](ReferenceStore& references) {
      return references.Add(actor, scan_id, reason, plan);
    });
  }

  void AddPlanning(const Actor& actor, const std::string& patient_id, const web::SentPlanning& sent,
                   Done done) override {
    if (!store_.Read(&Store::patients, [&](PatientStore& all) { return all.Find(patient_id); }))
      return done(Refused(ChangeResult::kNotFound, say::store::NoPatient()));
    if (RefuseIf(WhyNoNewScan(patient_id), done)) return;
    const Settings settings =
        store_.Read(&Store::settings, [](SettingsStore& stored) { return stored.Get(); });
    // An upload and received files may be on their way at the same time.
    const auto staging = [name = fmt::format("planning-{}", ++num_imports_)](Store& store) {
      return store.folders.Staging(name);
    };
    const auto state = [](Store& store) { return store.folders.state(); };
    auto import = std::make_shared<ArrivingPlanning>(
        ArrivingPlanning::Folders{.staging = store_.Read(staging),
                                  .earlier = EarlierPlanning(patient_id),
                                  .state = store_.Read(state)});
    const auto why_not = [=, this](const std::string& hash) {
      return WhyNotTaken(sent, WhyOtherPatient(patient_id, hash));
    };
    const auto work = [import, sent, why_not, stop = stop_] { import->Read(sent, why_not, stop); };
    const auto read = [=, this, plan = DefaultPlan(settings)]() mutable {
      if (import->refusal()) return done(*import->refusal());
      // It may have been opened in the minutes that an import takes.
      if (RefuseIf(WhyNoNewScan(patient_id), done)) return;
      const Message doubt = WhyOtherPatient(patient_id, import->patient_hash());
      if (RefuseIf(WhyNotTaken(sent, doubt), done)) return;  // another import may have ended
      plan.posture = Name(import->posture());
      plan.isocentre_m = {0, 0, 0};
      plan.couch_markers = false;
      const ReferenceOrigin origin{.source = ReferenceSource::kPlanningCt,
                                   .patient_hash = import->patient_hash(),
                                   .confirmed = doubt};
      const Done stored = Stored(actor, plan, sent.reason, origin, done);
      store_.Write(&Store::scans, stored, [=](ScanStore& scans) {
        return scans.AddMade({.patient_id = patient_id,
                              .reference_id = {},
                              .purpose = ScanPurpose::kReference,
                              .sensor_serial = {},
                              .reason = sent.reason},
                             import->staging());
      });
    };
    if (!background_.RunInBackground(web::BackgroundPool::kImports, work, read))
      done(AnswerOf(say::scan::ImportRuns()));
  }

  void PlanReference(const Actor& actor, const std::string& id, int revision,
                     const ReferencePlan& plan, Done done) override {
    if (const auto planning = PlanningOf(FindReference(id))) {
      const bool is_same = plan.posture == Name(planning->posture) && !plan.couch_markers &&
                           plan.isocentre_m == std::array<double, 3>{0, 0, 0};
      if (!is_same) return done(Refused(ChangeResult::kInvalid, say::scan::PlanningIsFixed()));
    } else if (plan.clothing_mm != 0 || plan.ct_breathing_mm != 0) {
      return done(Refused(ChangeResult::kInvalid, say::scan::SurfaceOfPlanning()));
    }
    store_.Write(&Store::references, std::move(done), [=](ReferenceStore& references) {
      const std::string planned = references.Plan(actor, id, revision, plan);
      return planned == id ? std::string() : planned;  // only a new version was made
    });
  }

  void ApproveReference(const Actor& actor, const std::string& id, int revision,
                        const std::string& digest, const web::Considered& considered,
                        Done done) override {
    const std::optional<Reference> reference = FindReference(id);
    const std::optional<Scan> scan = reference ? ScanOf(reference->scan_id) : std::optional<Scan>();
    // What no sensor took needs neither a checked room nor a warm sensor.
    const std::optional<PlanningSource> planning = PlanningOf(reference);
    const bool is_sweep = !planning;
    const std::optional<double> skin_hu =
        planning ? planning->skin_threshold_hu : std::optional<double>();
    if (skin_hu && !considered.images) return done(AnswerOf(say::store::ReferenceImages(*skin_hu)));
    if (is_sweep && RefuseIf(references_.WhyNot(scan), done)) return;
    if (is_sweep && scan && considered.reason.empty() &&
        !QualityOf(*scan, FilesOf(*scan), references_.warm_up_min()).cautions.empty())
      return done(AnswerOf(say::store::ReferenceNeedsReason()));
    const auto doubts = std::make_shared<Doubts>();
    const auto work = [=, this] {
      try {
        if (reference) *doubts = DoubtsOf(*reference);
      } catch (const std::exception& error) {  // Approve() compares every file, and says it
        Log(LogLevel::kError,
            fmt::format("cannot read the scene of reference {}: {}", id, error.what()));
      }
    };
    const auto approve = [=, this] {
      if (doubts->isocentre_away_m > kMostIsocentreAway_m)
        return done(AnswerOf(say::store::ReferenceIsocentre(doubts->isocentre_away_m)));
      if (doubts->posture && !considered.posture)
        return done(AnswerOf(say::store::ReferencePosture()));
      store_.Write(&Store::references, done, [=](ReferenceStore& references) {
        references.Approve(actor, id, revision, digest, /*two_users=*/true, considered.reason,
                           {.posture = doubts->posture, .skin_threshold_hu = skin_hu});
      });
    };
    if (!background_.RunInBackground(web::BackgroundPool::kReads, work, approve))
      done(Refused(ChangeResult::kFailed, say::upkeep::StoreBusy()));
  }

 private:
  /// What of a plan the surface speaks against.
  struct Doubts {
    bool posture = false;
    double isocentre_away_m = 0.0;  ///< From the surface.
  };
  /// Reads the whole scene.
  Doubts DoubtsOf(const Reference& reference) {
    const std::optional<Scan> scan = ScanOf(reference.scan_id);
    const auto posture = Named<PatientPosture>(reference.plan.posture);
    if (!scan || scan->folder.empty()) return {};
    const Scene scene = ReadScene(scan->folder / "scene");
    const std::optional<Pose> room =
        scene.planning ? std::optional(Pose::Identity()) : room_.AxesIn(scene.markers);
    Doubts doubts{.posture = room && posture && ContradictsPosture(scene, *room, *posture)};
    if (reference.plan.isocentre_m)
      doubts.isocentre_away_m = IsocentreAway_m(scene, *reference.plan.isocentre_m);
    return doubts;
  }

  std::optional<Scan> ScanOf(const std::string& scan_id) {
    return store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(scan_id); });
  }

  /// The plan that a reference was imported from; nothing for a sweep.
  std::optional<PlanningSource> PlanningOf(const std::optional<Reference>& reference) {
    const auto scan = reference ? ScanOf(reference->scan_id) : std::optional<Scan>();
    if (!scan || scan->folder.empty() || !scan->sensor_serial.empty()) return std::nullopt;
    return ReadStoredScene(scan->folder / "scene").scene.planning;
  }

  /// Why no scan may be stored beside the sensor's; empty: one may. The result of an open session
  /// could not be accepted any more: a newer scan would be there.
  [[nodiscard]] Message WhyNoNewScan(const std::string& patient_id) const {
    return session_.patient_id() == patient_id ? say::store::SessionOpen() : Message();
  }

  /// @param doubt  As of WhyOtherPatient().
  static Message WhyNotTaken(const web::SentPlanning& sent, const Message& doubt) {
    if (doubt.empty()) return {};
    if (!sent.is_same_patient) return doubt;
    return sent.reason.empty() ? say::store::PlanningNeedsReason() : Message();
  }

  /// What speaks against these files being this patient's; empty: nothing.
  Message WhyOtherPatient(const std::string& patient_id, const std::string& hash) {
    const KnownPlanning known = store_.Read(&Store::references, [&](ReferenceStore& references) {
      return references.PlanningOf(patient_id, hash);
    });
    if (!known.other_code.empty()) return say::store::PlanningPatientOf(known.other_code);
    if (known.version == 0) return {};
    switch (ComparePatientHashes(known.patient_hash, hash)) {
      case SamePatient::kSame:
        return {};
      case SamePatient::kOther:
        return say::store::PlanningPatientDiffers(known.version);
      case SamePatient::kUnknown:
        return say::store::PlanningPatientUnknown(known.version);
    }
    return {};
  }

  /// Scene folder of the newest reference of this patient; empty if it has none.
  std::filesystem::path EarlierPlanning(const std::string& patient_id) {
    const std::vector<Reference> all = References(patient_id);
    const auto scan = all.empty() ? std::optional<Scan>() : ScanOf(all.front().scan_id);
    return scan && !scan->folder.empty() ? scan->folder / "scene" : std::filesystem::path();
  }

  /// What follows once the scene is a scan: the draft made of it.
  Done Stored(const Actor& actor, const ReferencePlan& plan, const std::string& reason,
              const ReferenceOrigin& origin, Done done) {
    return [=, this, done = std::move(done)](const Change& change) {
      if (change.result != ChangeResult::kDone) return done(change);
      store_.Write(&Store::references, done, [=, scan = change.id](ReferenceStore& references) {
        return references.Add(actor, scan, reason, plan, origin);
      });
    };
  }

  const ReferenceGate& references_;
  const CurrentSession& session_;
  const RoomInUse& room_;
  StoreAccess& store_;
  web::BackgroundWork& background_;
  const std::stop_token stop_;
  int num_imports_ = 0;
};

}  // namespace

std::unique_ptr<web::ReferenceService> MakeWebReferences(const ReferenceGate& references,
                                                         const CurrentSession& session,
                                                         const RoomInUse& room, StoreAccess& store,
                                                         web::BackgroundWork& background,
                                                         std::stop_token stop) {
  return std::make_unique<WebReferences>(references, session, room, store, background,
                                         std::move(stop));
}

}  // namespace plumb
