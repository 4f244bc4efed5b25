#include "daemon/appliance/web_patients.hpp"

#include <utility>

#include <fmt/format.h>

namespace plumb {

using web::ChangeResult;

namespace {

/// Why this patient cannot be opened for that purpose; empty if it can.
std::string WhyNotOpen(bool is_running, const web::Patient& patient, web::ScanPurpose purpose) {
  if (is_running) return "a scan is running: wait for its result, then open the patient";
  if (purpose == web::ScanPurpose::kFraction && patient.approved_reference_id.empty())
    return "this patient has no approved reference: scan and approve one first";
  return {};
}

}  // namespace

std::vector<web::Patient> WebPatients::Patients() {
  return store_.Read(&Store::patients, [](PatientStore& patients) { return patients.List(); });
}

std::optional<web::Patient> WebPatients::FindPatient(const std::string& id) {
  return store_.Read(&Store::patients, [&](PatientStore& patients) { return patients.Find(id); });
}

void WebPatients::AddPatient(const web::Actor& actor, const std::string& code,
                             const std::string& site, web::Done done) {
  store_.Change(&Store::patients, std::move(done),
                [=](PatientStore& patients) { return patients.Add(actor, code, site); });
}

void WebPatients::ChangePatient(const web::Actor& actor, const std::string& id,
                                const web::CourseNotes& wanted,
                                const std::optional<web::CourseNotes>& shown, web::Done done) {
  store_.Change(&Store::patients, std::move(done), [=](PatientStore& patients) {
    patients.Change(actor, id, wanted.site, wanted.note, shown);
  });
}

void WebPatients::ArchivePatient(const web::Actor& actor, const std::string& id, bool archived,
                                 web::Done done) {
  store_.Change(&Store::patients, std::move(done),
                [=](PatientStore& patients) { patients.Archive(actor, id, archived); });
}

void WebPatients::WipePatient(const web::Actor& actor, const std::string& id, web::Done done) {
  const web::Status status = appliance_.WebStatus();
  if (status.scan && status.scan->patient_id == id) {
    return done(AnswerOf("a scan of this patient is running: end or cancel it first"));
  }
  const bool is_open = appliance_.open_patient() == id;
  if (is_open) {
    if (const std::string why = appliance_.WhyNotChangeSession(); !why.empty())
      return done(AnswerOf(why));
    appliance_.SetWiping(true);
  }
  // The session ends once the data is removed. A removal that is refused changes nothing.
  const web::Done wiped = [this, id, is_open, done = std::move(done)](const web::Change& change) {
    if (is_open) appliance_.SetWiping(false);
    if (change.result == ChangeResult::kDone) appliance_.ClosePatient(id);
    done(change);
  };
  store_.Change(&Store::removal, wiped,
                [=](StoreRemoval& removal) { removal.WipePatient(actor, id); });
}

void WebPatients::OpenPatient(const web::Actor& actor, const std::string& id,
                              web::ScanPurpose purpose, const std::string& reason,
                              const std::string& replaces, web::Done done) {
  const std::optional<web::Patient> patient = FindPatient(id);
  if (!patient) return done(Refusal(ChangeResult::kNotFound, "there is no such patient"));
  if (purpose == web::ScanPurpose::kDailyCheck) {
    return done(
        Refusal(ChangeResult::kInvalid, "a daily check is of no patient: open it as a check"));
  }
  if (const std::string why = WhyNotOpen(appliance_.IsRunning(), *patient, purpose); !why.empty())
    return done(AnswerOf(why));
  if (const std::string why = appliance_.WhyNotChangeSession(); !why.empty())
    return done(AnswerOf(why));
  if (const std::string why = appliance_.WhyBlocked(); !why.empty()) return done(AnswerOf(why));
  if (purpose == web::ScanPurpose::kReference) {
    if (const std::string why = appliance_.WhyNoReference(); !why.empty())
      return done(AnswerOf(why));
  }
  const auto open = appliance_.WebStatus().session;
  if (open && open->patient_id == id && open->purpose == purpose &&
      purpose == web::ScanPurpose::kFraction) {
    appliance_.OpenSession(open->id, id, purpose, reason, actor);
    return done({.result = ChangeResult::kDone, .message = {}, .id = open->id, .file = {}});
  }
  if (open && open->patient_id != id && open->id != replaces) {
    return done(AnswerOf(fmt::format("the session of {} is open (opened by {}): close it first",
                                     open->patient_code, open->opened_by)));
  }
  appliance_.SetOpening(true);
  const web::Done opened = [this, actor, id, purpose, reason,
                            done = std::move(done)](const web::Change& change) {
    appliance_.SetOpening(false);
    if (change.result == ChangeResult::kDone)
      appliance_.OpenSession(change.id, id, purpose, reason, actor);
    done(change);
  };
  store_.Change(&Store::treatments, opened,
                [=](TreatmentStore& treatments) { return treatments.Open(actor, id, purpose); });
}

void WebPatients::CloseSession(const web::Actor& actor, const std::string& session_id,
                               web::Done done) {
  if (!session_id.empty() && appliance_.session_id() != session_id)
    return done(AnswerOf("this session is closed already, or another one is open by now"));
  done(AnswerOf(appliance_.CloseSession(actor)));
}

}  // namespace plumb
