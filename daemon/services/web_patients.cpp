// SPDX-License-Identifier: Apache-2.0
// The page's services for patients and references.
#include "daemon/services/web_services.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/appliance/plan_options.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/result/scan_quality.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"

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
              StoreAccess& store)
      : appliance_(appliance), session_(session), references_(references), store_(store) {}

  std::vector<Patient> Patients() override {
    return store_.Read(&Store::patients, [](PatientStore& patients) { return patients.List(); });
  }

  std::optional<Patient> FindPatient(const std::string& id) override {
    return store_.Read(&Store::patients, [&](PatientStore& patients) { return patients.Find(id); });
  }

  void AddPatient(const Actor& actor, const std::string& code, const std::string& site,
                  Done done) override {
    store_.Write(&Store::patients, std::move(done),
                 [=](PatientStore& patients) { return patients.Add(actor, code, site); });
  }

  void ChangePatient(const Actor& actor, const std::string& id, const CourseNotes& wanted,
                     const std::optional<CourseNotes>& shown, Done done) override {
    store_.Write(&Store::patients, std::move(done), [=](PatientStore& patients) {
      patients.Change(actor, id, wanted.site, wanted.note, shown);
    });
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
  StoreAccess& store_;
};

class WebReferences final : public web::ReferenceService {
 public:
  WebReferences(const ReferenceGate& references, const RoomInUse& room, StoreAccess& store)
      : references_(references), room_(room), store_(store) {}

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
      const MarkerMap markers = ReadStoredScene(scan->folder / "scene").scene.markers;
      const auto ways = room_.In(markers);
      if (!ways) return {};
      RoomOnMap room{.gantry_xy = {ways->gantry.x(), ways->gantry.y()},
                     .right_xy = {ways->right.x(), ways->right.y()},
                     .is_known = true};
      if (const auto lasers = room_.LasersIn(markers))
        room.lasers_m = {lasers->x(), lasers->y(), lasers->z()};
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
    store_.Write(&Store::references, std::move(done),
                 [=, plan = DefaultPlan(settings)](ReferenceStore& references) {
                   return references.Add(actor, scan_id, reason, plan);
                 });
  }

  void PlanReference(const Actor& actor, const std::string& id, int revision,
                     const ReferencePlan& plan, Done done) override {
    store_.Write(&Store::references, std::move(done), [=](ReferenceStore& references) {
      const std::string planned = references.Plan(actor, id, revision, plan);
      return planned == id ? std::string() : planned;  // only a new version was made
    });
  }

  void ApproveReference(const Actor& actor, const std::string& id, int revision,
                        const std::string& digest, const std::string& reason, Done done) override {
    const std::optional<Reference> reference = FindReference(id);
    const std::optional<Scan> scan = reference ? ScanOf(reference->scan_id) : std::optional<Scan>();
    if (RefuseIf(references_.WhyNot(scan), done)) return;
    if (scan && reason.empty() &&
        !QualityOf(*scan, FilesOf(*scan), references_.warm_up_min()).cautions.empty())
      return done(AnswerOf(say::store::ReferenceNeedsReason()));
    store_.Write(&Store::references, std::move(done), [=](ReferenceStore& references) {
      references.Approve(actor, id, revision, digest, /*two_users=*/true, reason);
    });
  }

 private:
  std::optional<Scan> ScanOf(const std::string& scan_id) {
    return store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(scan_id); });
  }

  const ReferenceGate& references_;
  const RoomInUse& room_;
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::PatientService> MakeWebPatients(Appliance& appliance, CurrentSession& session,
                                                     const ReferenceGate& references,
                                                     StoreAccess& store) {
  return std::make_unique<WebPatients>(appliance, session, references, store);
}

std::unique_ptr<web::ReferenceService> MakeWebReferences(const ReferenceGate& references,
                                                         const RoomInUse& room,
                                                         StoreAccess& store) {
  return std::make_unique<WebReferences>(references, room, store);
}

}  // namespace plumb
