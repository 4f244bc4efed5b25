// SPDX-License-Identifier: Apache-2.0
// The page's services for patients and references.
#include "daemon/services/web_services.hpp"

#include <chrono>
#include <filesystem>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/names.hpp"
#include "daemon/appliance/plan_options.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/planning/patient_hash.hpp"
#include "daemon/planning/planning_import.hpp"
#include "daemon/reports/plan_doubts.hpp"
#include "daemon/reports/scan_quality.hpp"
#include "daemon/services/patient_key.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"
#include "words/upkeep.hpp"

namespace plumb {

namespace {

/// Why this patient cannot be opened for that purpose; empty if it can.
Message WhyNotOpen(bool is_running, const Patient& patient, ScanPurpose purpose) {
  if (is_running) return say::scan::ResultBeforeOpening();
  if (purpose == ScanPurpose::kFraction && patient.approved_reference_id.empty())
    return say::scan::NoApprovedReference();
  return {};
}

class WebPatients final : public web::PatientService {
 public:
  WebPatients(Appliance& appliance, CurrentSession& session, const ReferenceGate& references,
              Notices& notices, StoreAccess& store)
      : appliance_(appliance),
        session_(session),
        references_(references),
        notices_(notices),
        store_(store) {}

  std::vector<Patient> Patients() override {
    return store_.Read(&Store::patients, [](PatientStore& patients) { return patients.List(); });
  }

  std::optional<Patient> FindPatient(const std::string& id) override {
    return store_.Read(&Store::patients, [&](PatientStore& patients) { return patients.Find(id); });
  }

  void AddPatient(const Actor& actor, const std::string& code, const std::string& site,
                  Done done) override {
    const bool is_checked = store_.Read(&Store::settings, [](SettingsStore& settings) {
      return settings.Get().code_check_character;
    });
    if (is_checked && !HasCheckCharacter(code))
      return done(Refused(ChangeResult::kInvalid, say::store::PatientCodeCheck(code)));
    store_.Write(&Store::patients, std::move(done),
                 [=](PatientStore& patients) { return patients.Add(actor, code, site); });
  }

  void ChangePatient(const Actor& actor, const std::string& id, const CourseNotes& wanted,
                     const std::optional<CourseNotes>& shown, Done done) override {
    store_.Write(&Store::patients, std::move(done),
                 [=](PatientStore& patients) { patients.Change(actor, id, wanted, shown); });
  }

  std::optional<std::string> Photo(const std::string& id) override {
    return store_.Read(&Store::patients,
                       [&](PatientStore& patients) { return patients.Photo(id); });
  }

  void SetPhoto(const Actor& actor, const std::string& id, std::function<std::string()> take,
                Done done) override {
    store_.Write(&Store::patients, std::move(done), [=](PatientStore& patients) {
      patients.SetPhoto(actor, id, take ? take() : std::string());
    });
  }

  std::vector<DrawnPoint> Drawing(const std::string& id) override {
    return store_.Read(&Store::patients,
                       [&](PatientStore& patients) { return patients.Drawing(id); });
  }

  void SetDrawing(const Actor& actor, const std::string& id, const std::vector<DrawnPoint>& points,
                  int revision, Done done) override {
    store_.Write(&Store::patients, std::move(done),
                 [=](PatientStore& patients) { patients.SetDrawing(actor, id, points, revision); });
  }

  void ArchivePatient(const Actor& actor, const std::string& id, bool archived,
                      Done done) override {
    store_.Write(&Store::patients, std::move(done),
                 [=](PatientStore& patients) { patients.Archive(actor, id, archived); });
  }

  void WipePatient(const Actor& actor, const std::string& id, Done done) override {
    const Status status = appliance_.WebStatus();
    if (status.scan && status.scan->patient_id == id) {
      return done(AnswerOf(say::store::PatientIsScanned()));
    }
    const bool is_open = session_.patient_id() == id;
    if (is_open) {
      if (RefuseIf(session_.WhyNotChange(), done)) return;
      session_.SetWiping(true);
    }
    // The session ends once the data is removed. A removal that is refused changes nothing.
    const Done wiped = [this, id, is_open, done = std::move(done)](const Change& change) {
      if (is_open) session_.SetWiping(false);
      if (change.result == ChangeResult::kDone) appliance_.ClosePatient(id);
      done(change);
    };
    store_.Write(&Store::removal, wiped,
                 [=](StoreRemoval& removal) { removal.WipePatient(actor, id); });
  }

  void OpenPatient(const Actor& actor, const std::string& id, ScanPurpose purpose,
                   const std::string& reason, const std::string& replaces, Done done) override {
    const std::optional<Patient> patient = FindPatient(id);
    if (!patient) return done(Refused(ChangeResult::kNotFound, say::store::NoPatient()));
    if (purpose == ScanPurpose::kDailyCheck) {
      return done(Refused(ChangeResult::kInvalid, say::scan::CheckOfNoPatient()));
    }
    if (RefuseIf(WhyNotOpen(!appliance_.WhyNotIdle().empty(), *patient, purpose), done)) return;
    if (RefuseIf(session_.WhyNotChange(), done)) return;
    if (RefuseIf(session_.WhyBlocked(), done)) return;
    if (purpose == ScanPurpose::kReference && RefuseIf(references_.WhyNot(), done)) return;
    const auto open = appliance_.WebStatus().session;
    if (open && open->patient_id == id && open->purpose == purpose &&
        purpose == ScanPurpose::kFraction) {
      appliance_.OpenSession(open->id, id, purpose, reason, actor);
      return done(DoneWith(open->id));
    }
    if (open && open->patient_id != id && open->id != replaces) {
      return done(AnswerOf(say::scan::OtherSessionOpen(open->patient_code, open->opened_by)));
    }
    session_.SetOpening(true);
    store_.Write(&Store::treatments, Opened(actor, id, purpose, reason, std::move(done)),
                 [=](TreatmentStore& treatments) { return treatments.Open(actor, id, purpose); });
  }

  void ResumeSession(const Actor& actor, const std::string& session_id, const std::string& replaces,
                     Done done) override {
    const std::optional<std::string> patient =
        store_.Read(&Store::treatments,
                    [&](TreatmentStore& treatments) { return treatments.PatientOf(session_id); });
    if (!patient) return done(Refused(ChangeResult::kNotFound, say::store::NoSession()));
    if (!appliance_.WhyNotIdle().empty()) return done(AnswerOf(say::scan::ResultBeforeOpening()));
    if (RefuseIf(session_.WhyNotChange(), done) || RefuseIf(session_.WhyBlocked(), done)) return;
    const auto open = appliance_.WebStatus().session;
    if (open && open->id != replaces)
      return done(AnswerOf(say::scan::OtherSessionOpen(open->patient_code, open->opened_by)));
    session_.SetOpening(true);
    store_.Write(&Store::treatments,
                 Opened(actor, *patient, ScanPurpose::kFraction, "", std::move(done)),
                 [=](TreatmentStore& treatments) {
                   treatments.Resume(actor, session_id);
                   return session_id;
                 });
  }

  void ConfirmWristband(const Actor& actor, const std::string& session_id, const std::string& code,
                        Done done) override {
    if (session_.id() != session_id) return done(AnswerOf(say::scan::SessionClosed()));
    const std::optional<Patient> patient = FindPatient(session_.patient_id());
    if (!patient) return done(Refused(ChangeResult::kNotFound, say::store::NoPatient()));
    if (PlainPatientCode(code) != PlainPatientCode(patient->code))
      return done(AnswerOf(say::scan::OtherWristband(patient->code)));
    session_.ConfirmWristband(std::chrono::steady_clock::now());
    notices_.TellPage(web::EventKind::kStatus);
    store_.Write(&Store::audit, std::move(done), [=](AuditStore& audit) {
      audit.Log(actor, "session.wristband", session_id, Message());
    });
  }

  void CorrectFraction(const Actor& actor, const std::string& session_id, int fraction,
                       const std::string& reason, Done done) override {
    store_.Write(&Store::treatments, std::move(done), [=](TreatmentStore& treatments) {
      treatments.CorrectFraction(actor, session_id, fraction, reason);
    });
  }

  void UseReference(const Actor& actor, const std::string& session_id,
                    const std::string& reference_id, Done done) override {
    if (RefuseIf(appliance_.WhyNotIdle(), done) || RefuseIf(session_.WhyNotChange(), done)) return;
    if (session_.id() != session_id) return done(AnswerOf(say::scan::SessionClosed()));
    store_.Write(&Store::treatments, std::move(done), [=](TreatmentStore& treatments) {
      treatments.UseReference(actor, session_id, reference_id);
    });
  }

  void CloseSession(const Actor& actor, const std::string& session_id, Done done) override {
    if (!session_id.empty() && session_.id() != session_id)
      return done(AnswerOf(say::scan::SessionClosed()));
    done(AnswerOf(appliance_.CloseSession(actor)));
  }

 private:
  /// What follows once the store has opened a session: its id is that of the change.
  Done Opened(const Actor& actor, const std::string& patient, ScanPurpose purpose,
              const std::string& reason, Done done) {
    return [=, this, done = std::move(done)](const Change& change) {
      session_.SetOpening(false);
      if (change.result == ChangeResult::kDone)
        appliance_.OpenSession(change.id, patient, purpose, reason, actor);
      done(change);
    };
  }

  Appliance& appliance_;
  CurrentSession& session_;
  const ReferenceGate& references_;
  Notices& notices_;
  StoreAccess& store_;
};

/// The files of a planning CT on their way to a scene in the staging folder.
struct PlanningImport {
  std::filesystem::path staging, earlier;
  std::filesystem::path state;
  PatientPosture posture = PatientPosture::kHeadFirstSupine;
  std::string patient_hash;
  std::optional<Change> refusal;

  PlanningImport() = default;
  PlanningImport(const PlanningImport&) = delete;
  PlanningImport& operator=(const PlanningImport&) = delete;
  ~PlanningImport() {
    std::error_code ignored;
    if (!staging.empty()) std::filesystem::remove_all(staging, ignored);
  }

  /// Beside the loop; never throws.
  void Read(const web::SentPlanning& sent) noexcept {
    try {
      std::filesystem::remove_all(staging);
      std::filesystem::create_directories(staging);
      const std::filesystem::path plan = staging / "plan.dcm";
      SplitPlanning(sent.file, sent.structures_bytes, plan);
      PlanningChoice choice;
      if (!sent.roi.empty()) choice.roi = sent.roi;
      if (!sent.beam.empty()) choice.beam = sent.beam;
      auto [scene, patient_id] = ReadPlanning({.structures = sent.file,
                                               .plan = plan,
                                               .structures_name = "STRUCTURES",
                                               .plan_name = "PLAN"},
                                              choice);
      std::filesystem::remove(plan);  // it names the patient
      patient_hash = PatientHash(PatientKey(state), patient_id);
      CompareWithEarlierPlan(earlier, scene);
      posture = scene.planning->posture;
      WriteScene(scene, staging / "scene");
    } catch (const DataError& error) {
      refusal = Refused(ChangeResult::kInvalid, error.message());
    } catch (const std::exception& error) {
      refusal = Refused(ChangeResult::kFailed, MessageOf(error));
    }
  }
};

class WebReferences final : public web::ReferenceService {
 public:
  WebReferences(const ReferenceGate& references, const CurrentSession& session,
                const RoomInUse& room, StoreAccess& store, web::BackgroundWork& background)
      : references_(references),
        session_(session),
        room_(room),
        store_(store),
        background_(background) {}

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
      if (scene.planning)  // its map lies in IEC axes
        return {.gantry_xy = {0, 1}, .right_xy = {1, 0}, .is_known = true};
      const MarkerMap& markers = scene.markers;
      const auto ways = room_.In(markers);
      if (!ways) return {};
      RoomOnMap room{.gantry_xy = {ways->gantry.x(), ways->gantry.y()},
                     .right_xy = {ways->right.x(), ways->right.y()},
                     .is_known = true};
      if (const auto lasers = room_.LasersIn(markers))
        room.lasers_m = {lasers->x(), lasers->y(), lasers->z()};
      if (reference.approved_by.empty() && !reference.planned_by.empty())
        room.contradicts_posture = DoubtsOf(reference).posture;
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
    // The result of an open session could not be accepted any more: a newer scan would be there.
    if (session_.patient_id() == patient_id) return done(AnswerOf(say::store::SessionOpen()));
    const Settings settings =
        store_.Read(&Store::settings, [](SettingsStore& stored) { return stored.Get(); });
    auto import = std::make_shared<PlanningImport>();
    // An upload and received files may be on their way at the same time.
    const auto staging = [name = fmt::format("planning-{}", ++num_imports_)](Store& store) {
      return store.folders.Staging(name);
    };
    import->staging = store_.Read(staging);
    const auto state = [](Store& store) { return store.folders.state(); };
    import->state = store_.Read(state);
    import->earlier = EarlierPlanning(patient_id);
    const auto work = [import, sent] { import->Read(sent); };
    const auto read = [=, this, plan = DefaultPlan(settings)]() mutable {
      if (import->refusal) return done(*import->refusal);
      const Message doubt = WhyOtherPatient(patient_id, import->patient_hash);
      if (!doubt.empty() && !sent.is_same_patient) return done(AnswerOf(doubt));
      if (!doubt.empty() && sent.reason.empty())
        return done(AnswerOf(say::store::PlanningNeedsReason()));
      plan.posture = Name(import->posture);
      plan.isocentre_m = {0, 0, 0};
      plan.couch_markers = false;
      const ReferenceOrigin origin{.source = ReferenceSource::kPlanningCt,
                                   .patient_hash = import->patient_hash,
                                   .confirmed = doubt};
      const Done stored = Stored(actor, plan, sent.reason, origin, done);
      store_.Write(&Store::scans, stored, [=](ScanStore& scans) {
        return scans.AddMade({.patient_id = patient_id,
                              .reference_id = {},
                              .purpose = ScanPurpose::kReference,
                              .sensor_serial = {},
                              .reason = sent.reason},
                             import->staging);
      });
    };
    if (!background_.RunInBackground(web::BackgroundPool::kFiles, work, read))
      done(Refused(ChangeResult::kFailed, say::upkeep::StoreBusy()));
  }

  void PlanReference(const Actor& actor, const std::string& id, int revision,
                     const ReferencePlan& plan, Done done) override {
    if (const auto planning = PlanningOf(FindReference(id))) {
      const bool is_same = plan.posture == Name(planning->posture) && !plan.couch_markers &&
                           plan.isocentre_m == std::array<double, 3>{0, 0, 0};
      if (!is_same) return done(Refused(ChangeResult::kInvalid, say::scan::PlanningIsFixed()));
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
    const bool is_sweep = !PlanningOf(reference);
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
                           /*posture_confirmed=*/doubts->posture);
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
  int num_imports_ = 0;
};

}  // namespace

std::unique_ptr<web::PatientService> MakeWebPatients(Appliance& appliance, CurrentSession& session,
                                                     const ReferenceGate& references,
                                                     Notices& notices, StoreAccess& store) {
  return std::make_unique<WebPatients>(appliance, session, references, notices, store);
}

std::unique_ptr<web::ReferenceService> MakeWebReferences(const ReferenceGate& references,
                                                         const CurrentSession& session,
                                                         const RoomInUse& room, StoreAccess& store,
                                                         web::BackgroundWork& background) {
  return std::make_unique<WebReferences>(references, session, room, store, background);
}

}  // namespace plumb
