// The page's services for patients and references.
#include "daemon/appliance/web_services.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/log.hpp"

namespace plumb {

namespace {

/// Why this patient cannot be opened for that purpose; empty if it can.
std::string WhyNotOpen(bool is_running, const Patient& patient, ScanPurpose purpose) {
  if (is_running) return "a scan is running: wait for its result, then open the patient";
  if (purpose == ScanPurpose::kFraction && patient.approved_reference_id.empty())
    return "this patient has no approved reference: scan and approve one first";
  return {};
}

class WebPatients final : public web::PatientService {
 public:
  WebPatients(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

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
      return done(AnswerOf("a scan of this patient is running: end or cancel it first"));
    }
    const bool is_open = appliance_.session().patient_id() == id;
    if (is_open) {
      if (RefuseIf(appliance_.session().WhyNotChange(), done)) return;
      appliance_.session().SetWiping(true);
    }
    // The session ends once the data is removed. A removal that is refused changes nothing.
    const Done wiped = [this, id, is_open, done = std::move(done)](const Change& change) {
      if (is_open) appliance_.session().SetWiping(false);
      if (change.result == ChangeResult::kDone) appliance_.ClosePatient(id);
      done(change);
    };
    store_.Write(&Store::removal, wiped,
                 [=](StoreRemoval& removal) { removal.WipePatient(actor, id); });
  }

  void OpenPatient(const Actor& actor, const std::string& id, ScanPurpose purpose,
                   const std::string& reason, const std::string& replaces, Done done) override {
    const std::optional<Patient> patient = FindPatient(id);
    if (!patient) return done(Refused(ChangeResult::kNotFound, "there is no such patient"));
    if (purpose == ScanPurpose::kDailyCheck) {
      return done(
          Refused(ChangeResult::kInvalid, "a daily check is of no patient: open it as a check"));
    }
    if (RefuseIf(WhyNotOpen(appliance_.IsRunning(), *patient, purpose), done)) return;
    if (RefuseIf(appliance_.session().WhyNotChange(), done)) return;
    if (RefuseIf(appliance_.WhyBlocked(), done)) return;
    if (purpose == ScanPurpose::kReference && RefuseIf(appliance_.references().WhyNot(), done))
      return;
    const auto open = appliance_.WebStatus().session;
    if (open && open->patient_id == id && open->purpose == purpose &&
        purpose == ScanPurpose::kFraction) {
      appliance_.OpenSession(open->id, id, purpose, reason, actor);
      return done(DoneWith(open->id));
    }
    if (open && open->patient_id != id && open->id != replaces) {
      return done(AnswerOf(fmt::format("the session of {} is open (opened by {}): close it first",
                                       open->patient_code, open->opened_by)));
    }
    appliance_.session().SetOpening(true);
    const Done opened = [this, actor, id, purpose, reason,
                         done = std::move(done)](const Change& change) {
      appliance_.session().SetOpening(false);
      if (change.result == ChangeResult::kDone)
        appliance_.OpenSession(change.id, id, purpose, reason, actor);
      done(change);
    };
    store_.Write(&Store::treatments, opened,
                 [=](TreatmentStore& treatments) { return treatments.Open(actor, id, purpose); });
  }

  void CloseSession(const Actor& actor, const std::string& session_id, Done done) override {
    if (!session_id.empty() && appliance_.session().id() != session_id)
      return done(AnswerOf("this session is closed already, or another one is open by now"));
    done(AnswerOf(appliance_.CloseSession(actor)));
  }

 private:
  Appliance& appliance_;
  StoreAccess& store_;
};

class WebReferences final : public web::ReferenceService {
 public:
  WebReferences(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

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
      const auto ways = appliance_.room().In(ReadSceneMarkers(scan->folder / "scene"));
      if (!ways) return {};
      return {.gantry_xy = {ways->gantry.x(), ways->gantry.y()},
              .right_xy = {ways->right.x(), ways->right.y()},
              .is_known = true};
    } catch (const std::exception& error) {
      Log(LogLevel::kNotice,
          fmt::format("no room for reference {}: {}", reference.id, error.what()));
      return {};
    }
  }

  void AddReference(const Actor& actor, const std::string& scan_id, const std::string& reason,
                    Done done) override {
    const std::optional<Scan> scan = ScanOf(scan_id);
    if (RefuseIf(appliance_.references().WhyNot(scan), done)) return;
    store_.Write(&Store::references, std::move(done),
                 [=, appliance = &appliance_](ReferenceStore& references) {
                   return references.Add(actor, scan_id, reason, appliance->DefaultPlan());
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
                        const std::string& digest, Done done) override {
    const std::optional<Reference> reference = FindReference(id);
    const std::optional<Scan> scan = reference ? ScanOf(reference->scan_id) : std::optional<Scan>();
    if (RefuseIf(appliance_.references().WhyNot(scan), done)) return;
    store_.Write(&Store::references, std::move(done), [=](ReferenceStore& references) {
      references.Approve(actor, id, revision, digest);
    });
  }

 private:
  std::optional<Scan> ScanOf(const std::string& scan_id) {
    return store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(scan_id); });
  }

  Appliance& appliance_;
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::PatientService> MakeWebPatients(Appliance& appliance, StoreAccess& store) {
  return std::make_unique<WebPatients>(appliance, store);
}

std::unique_ptr<web::ReferenceService> MakeWebReferences(Appliance& appliance, StoreAccess& store) {
  return std::make_unique<WebReferences>(appliance, store);
}

}  // namespace plumb
