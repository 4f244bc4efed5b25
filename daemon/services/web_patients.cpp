// SPDX-License-Identifier: Apache-2.0
// The page's service for patients.
#include "daemon/services/web_services.hpp"

#include <chrono>
#include <memory>
#include <utility>

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
    if (PlainCode(code) != PlainCode(patient->code))
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

}  // namespace

std::unique_ptr<web::PatientService> MakeWebPatients(Appliance& appliance, CurrentSession& session,
                                                     const ReferenceGate& references,
                                                     Notices& notices, StoreAccess& store) {
  return std::make_unique<WebPatients>(appliance, session, references, notices, store);
}

}  // namespace plumb
