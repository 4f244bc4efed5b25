// SPDX-License-Identifier: Apache-2.0
// The patients, references and scans of the appliance without a sensor.
#include "tests/support/fake_appliance.hpp"

#include <fmt/format.h>
#include <strings.h>

#include <algorithm>

#include "algo/base/errors.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"

namespace plumb::test {

using namespace web;  // NOLINT: a test's own names are none of these

namespace {

template <typename T>
std::optional<T> FindById(const std::vector<T>& items, const std::string& id) {
  const auto found =
      std::find_if(items.begin(), items.end(), [&](const T& item) { return item.id == id; });
  return found == items.end() ? std::nullopt : std::optional(*found);
}

ReferenceVersion VersionOf(const Reference& reference) {
  return {.id = reference.id, .version = reference.version, .source = reference.origin.source};
}

}  // namespace

Patient* FakeAppliance::PatientOf(const std::string& id) {
  const auto found = std::find_if(patients.begin(), patients.end(),
                                  [&](const Patient& patient) { return patient.id == id; });
  return found == patients.end() ? nullptr : &*found;
}

Reference& FakeAppliance::MakeReference(const Scan& scan, const std::string& by,
                                        const std::string& reason) {
  Reference reference;
  reference.id = fmt::format("r{:04}", next_id_++);
  reference.patient_id = scan.patient_id;
  reference.version = static_cast<int>(References(scan.patient_id).size()) + 1;
  reference.scan_id = scan.id;
  reference.created_at = WallClock::now();
  reference.created_by = by;
  reference.reason = reason.empty() ? Message() : Message::Verbatim(reason);
  reference.plan.tolerance = settings.tolerance;
  reference.digest = "digest of " + reference.id + " 1";
  references.push_back(reference);
  TellWaiting();
  return references.back();
}

std::optional<Patient> FakeAppliance::FindPatient(const std::string& id) {
  return FindById(patients, id);
}

void FakeAppliance::AddPatient(const Actor& actor, const std::string& code, const std::string& site,
                               Done done) {
  if (settings.code_check_character && !HasCheckCharacter(code))
    return Finish(done, Refused(ChangeResult::kInvalid, say::store::PatientCodeCheck(code)));
  const auto plain = [](std::string text) {
    std::erase(text, '-');
    return text;
  };
  if (std::any_of(patients.begin(), patients.end(), [&](const Patient& patient) {
        return strcasecmp(plain(patient.code).c_str(), plain(code).c_str()) == 0;
      })) {
    return Finish(done, Refused(ChangeResult::kConflict, "there is a patient of this code"));
  }
  patients.push_back({fmt::format("p{:04}", next_id_++), code, site, WallClock::now(), "", 0, ""});
  Did(actor, "patient.add", patients.back().id, done, patients.back().id);
}

void FakeAppliance::ChangePatient(const Actor& actor, const std::string& id,
                                  const CourseNotes& wanted,
                                  const std::optional<CourseNotes>& shown, Done done) {
  for (Patient& patient : patients) {
    if (patient.id != id) continue;
    const auto differs = [](const auto& one, const std::string& other) {
      return one && *one != other;
    };
    if (shown && (shown->site != patient.site || shown->note != patient.note ||
                  differs(shown->immobilisation, patient.immobilisation) ||
                  differs(shown->alert, patient.alert)))
      return Finish(done, Refused(ChangeResult::kConflict,
                                  "this patient was changed by somebody else meanwhile: look "
                                  "again, then save"));
    patient.site = wanted.site;
    patient.note = wanted.note;
    patient.immobilisation = wanted.immobilisation.value_or(patient.immobilisation);
    patient.alert = wanted.alert.value_or(patient.alert);
    return Did(actor, "patient.change", id, done);
  }
  Finish(done, Refused(ChangeResult::kNotFound, "there is no such patient"));
}

void FakeAppliance::SetPhoto(const Actor& actor, const std::string& id,
                             std::function<std::string()> take, Done done) {
  Patient* patient = PatientOf(id);
  if (patient == nullptr)
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no such patient"));
  patient->has_photo = static_cast<bool>(take);
  patient->has_drawing = false;
  ++patient->sheet_revision;
  photos_.erase(id);
  drawings_.erase(id);
  if (take) photos_[id] = take();
  Did(actor, take ? "patient.photo" : "patient.photo_remove", id, done);
}

void FakeAppliance::SetDrawing(const Actor& actor, const std::string& id,
                               const std::vector<DrawnPoint>& points, int revision, Done done) {
  Patient* patient = PatientOf(id);
  if (patient == nullptr)
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no such patient"));
  if (patient->sheet_revision != revision)
    return Finish(done, Refused(ChangeResult::kConflict, say::store::SheetChanged()));
  patient->has_drawing = !points.empty();
  ++patient->sheet_revision;
  drawings_[id] = points;
  Did(actor, points.empty() ? "patient.drawing_remove" : "patient.drawing", id, done);
}

void FakeAppliance::ArchivePatient(const Actor& actor, const std::string& id, bool archived,
                                   Done done) {
  for (Patient& patient : patients) {
    if (patient.id != id) continue;
    if (archived && status.session && status.session->patient_id == id)
      return Finish(done, Refused(ChangeResult::kConflict,
                                  "the session of this patient is open: close it first"));
    patient.archived = archived;
    return Did(actor, archived ? "patient.archive" : "patient.unarchive", id, done);
  }
  Finish(done, Refused(ChangeResult::kNotFound, "there is no such patient"));
}

void FakeAppliance::WipePatient(const Actor& actor, const std::string& id, Done done) {
  if (std::erase_if(patients, [&](const Patient& patient) { return patient.id == id; }) == 0) {
    return Finish(done, Refused(ChangeResult::kNotFound, "no such patient"));
  }
  std::erase_if(references, [&](const Reference& reference) { return reference.patient_id == id; });
  std::erase_if(scans, [&](const Scan& scan) { return scan.patient_id == id; });
  if (status.patient_id == id) {
    status.patient_id.clear();
    status.session.reset();
  }
  if (status.last_result && status.last_result->patient_id == id) status.last_result.reset();
  Notify(EventKind::kStatus);
  Did(actor, "patient.wipe", id, done);
}

void FakeAppliance::OpenPatient(const Actor& actor, const std::string& id, ScanPurpose purpose,
                                const std::string&, const std::string& replaces, Done done) {
  const Patient* patient = PatientOf(id);
  if (patient == nullptr) return Finish(done, Refused(ChangeResult::kNotFound, "no such patient"));
  if (purpose == ScanPurpose::kFraction && patient->approved_reference_id.empty()) {
    return Finish(done, Refused(ChangeResult::kConflict,
                                "this patient has no approved reference; take one first"));
  }
  if (status.scan) return Finish(done, Refused(ChangeResult::kConflict, "a scan is running"));
  if (patient->archived)
    return Finish(done, Refused(ChangeResult::kConflict,
                                "this patient is archived: take it out of the archive first"));
  if (purpose == ScanPurpose::kReference && !status.reference_block.empty())
    return Finish(done, Refused(ChangeResult::kConflict, status.reference_block));
  CloseCheck();
  if (status.session && status.session->patient_id == id && status.session->purpose == purpose) {
    const std::string same = status.session->id;
    return Did(actor, "session.open", same, done, same);
  }
  if (status.session && status.session->patient_id != id && status.session->id != replaces) {
    return Finish(done,
                  Refused(ChangeResult::kConflict,
                          fmt::format("the session of {} is open (opened by {}): close it "
                                      "first",
                                      status.session->patient_code, status.session->opened_by)));
  }
  if (status.session) EndSession();
  if (purpose == ScanPurpose::kFraction) PatientOf(id)->last_session.reset();
  status.patient_id = id;
  status.next_purpose = purpose;
  status.scans_today = 0;
  const int fraction = purpose == ScanPurpose::kFraction ? ++num_fractions_[id] : 0;
  status.session = TreatmentSession{.id = fmt::format("t{:04}", next_id_++),
                                    .patient_id = id,
                                    .patient_code = patient->code,
                                    .purpose = purpose,
                                    .fraction = fraction,
                                    .num_scans = 0,
                                    .opened_by = actor.user,
                                    .opened_at = WallClock::now()};
  status.session->language = preferences_[actor.user].language;
  for (const PlanTemplate& one : Templates())
    if (strcasecmp(one.site.c_str(), patient->site.c_str()) == 0)
      status.session->sweep_hint = one.hint;
  if (const auto approved = FindReference(patient->approved_reference_id);
      approved && purpose == ScanPurpose::kFraction)
    status.session->reference = VersionOf(*approved);
  chosen_at_reference_.clear();
  TellNewerReference();
  sessions_[status.session->id] = *status.session;
  Notify(EventKind::kStatus);
  Did(actor, "session.open", status.session->id, done, status.session->id);
}

void FakeAppliance::TellNewerReference() {
  if (!status.session || !status.session->reference) return;
  status.session->reference_created_at =
      FindReference(status.session->reference->id).value().created_at;
  status.session->newer_reference.reset();
  status.session->other_reference.reset();
  const Patient* patient = PatientOf(status.session->patient_id);
  if (patient == nullptr) return;
  for (const Reference& other : References(patient->id)) {
    if (other.approved_by.empty() || other.origin.source == status.session->reference->source)
      continue;
    status.session->other_reference = VersionOf(other);
    break;
  }
  const std::string& newest = patient->approved_reference_id;
  if (newest == status.session->reference->id || newest == chosen_at_reference_) return;
  if (const auto newer = FindReference(newest)) status.session->newer_reference = VersionOf(*newer);
}

void FakeAppliance::ResumeSession(const Actor& actor, const std::string& session_id,
                                  const std::string& replaces, Done done) {
  const auto found = sessions_.find(session_id);
  if (found == sessions_.end())
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no such session for fractions"));
  Patient* patient = PatientOf(found->second.patient_id);
  if (patient == nullptr || !patient->last_session || patient->last_session->id != session_id)
    return Finish(done, Refused(ChangeResult::kConflict, "only the newest session goes on"));
  if (status.session && status.session->id != replaces)
    return Finish(done, Refused(ChangeResult::kConflict, "another session is open"));
  CloseCheck();
  patient->last_session.reset();
  status.session = found->second;
  status.session->opened_by = actor.user;
  status.patient_id = patient->id;
  status.next_purpose = ScanPurpose::kFraction;
  TellNewerReference();
  Notify(EventKind::kStatus);
  Did(actor, "session.resume", session_id, done, session_id);
}

void FakeAppliance::CorrectFraction(const Actor& actor, const std::string& session_id, int fraction,
                                    const std::string&, Done done) {
  const auto found = sessions_.find(session_id);
  if (found == sessions_.end() || found->second.purpose != ScanPurpose::kFraction)
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no such session for fractions"));
  found->second.fraction = fraction;
  num_fractions_[found->second.patient_id] = fraction;
  for (Scan& scan : scans)
    if (scan.session_id == session_id) scan.fraction = fraction;
  if (status.session && status.session->id == session_id) status.session->fraction = fraction;
  if (Patient* patient = PatientOf(found->second.patient_id);
      patient != nullptr && patient->last_session && patient->last_session->id == session_id)
    patient->last_session->fraction = fraction;
  Notify(EventKind::kStatus);
  Did(actor, "session.fraction", session_id, done);
}

void FakeAppliance::EndSession() {
  Patient* patient = PatientOf(status.session->patient_id);
  sessions_[status.session->id] = *status.session;
  const bool is_resumable =
      status.session->purpose == ScanPurpose::kFraction && status.session->num_scans > 0;
  if (patient != nullptr && is_resumable)
    patient->last_session = {.id = status.session->id,
                             .fraction = status.session->fraction,
                             .num_scans = status.session->num_scans,
                             .closed_at = WallClock::now()};
  status.session.reset();
}

void FakeAppliance::UseReference(const Actor& actor, const std::string& session_id,
                                 const std::string& reference_id, Done done) {
  TellNewerReference();
  if (status.scan) return Finish(done, Refused(ChangeResult::kConflict, "a scan is running"));
  if (!status.session || status.session->id != session_id)
    return Finish(done, Refused(ChangeResult::kConflict, "this session is closed already"));
  const auto is_asked = [&](const std::optional<ReferenceVersion>& one) {
    return one && one->id == reference_id;
  };
  if (!is_asked(status.session->newer_reference) && !is_asked(status.session->other_reference))
    return Finish(done, Refused(ChangeResult::kConflict, "another version is approved by now"));
  status.session->reference = VersionOf(FindReference(reference_id).value());
  chosen_at_reference_ = PatientOf(status.session->patient_id)->approved_reference_id;
  TellNewerReference();
  Notify(EventKind::kStatus);
  Did(actor, "session.reference", session_id, done);
}

void FakeAppliance::CloseSession(const Actor& actor, const std::string& session_id, Done done) {
  if (status.scan) return Finish(done, Refused(ChangeResult::kConflict, "a scan is running"));
  if (!status.session || (!session_id.empty() && status.session->id != session_id))
    return Finish(done, Refused(ChangeResult::kConflict, "this session is closed already"));
  const std::string id = status.session->id;
  EndSession();
  status.patient_id.clear();
  status.next_purpose = ScanPurpose::kFraction;
  Notify(EventKind::kStatus);
  Did(actor, "session.close", id, done);
}

std::optional<AuditSubject> FakeAppliance::SubjectOf(const AuditEntry& entry) {
  const auto begins = [&](const char* action) { return entry.action.starts_with(action); };
  const auto about = [&](const char* kind, bool exists, const std::string& patient_id, int number) {
    AuditSubject subject;
    subject.kind = kind;
    subject.exists = exists;
    if (const Patient* patient = PatientOf(patient_id)) subject.patient_code = patient->code;
    subject.number = number;
    return subject;
  };
  const std::string& id = entry.subject;
  if (id.empty()) return std::nullopt;
  if (begins("patient.") || entry.action == "view.patient")
    return about("patient", PatientOf(id) != nullptr, id, 0);
  if (begins("session.")) {
    const auto found = sessions_.find(id);
    if (found == sessions_.end()) return about("session", false, "", 0);
    return about("session", true, found->second.patient_id, found->second.fraction);
  }
  if (begins("reference.") || entry.action == "view.reference") {
    const auto reference = FindReference(id);
    if (!reference) return about("reference", false, "", 0);
    return about("reference", true, reference->patient_id, reference->version);
  }
  if (begins("scan.") || entry.action == "view.scan") {
    const auto scan = FindScan(id);
    return scan ? about("scan", true, scan->patient_id, 0) : about("scan", false, "", 0);
  }
  return std::nullopt;
}

void FakeAppliance::TellWaiting() {
  status.waiting.clear();
  for (Patient& patient : patients) {
    const auto found = References(patient.id);
    patient.draft_reference_id =
        !found.empty() && found.front().approved_by.empty() ? found.front().id : "";
    if (!patient.draft_reference_id.empty())
      status.waiting.push_back({.reference_id = patient.draft_reference_id,
                                .patient_id = patient.id,
                                .patient_code = patient.code,
                                .version = found.front().version,
                                .planned_by = found.front().planned_by});
  }
}

bool FakeAppliance::IsOld(const Scan& scan) const {
  return !scan.finished_at || WallClock::now() - *scan.finished_at >
                                  std::chrono::seconds(static_cast<int>(kResultValid_s));
}

std::vector<Reference> FakeAppliance::References(const std::string& patient_id) {
  std::vector<Reference> found;
  std::copy_if(references.rbegin(), references.rend(), std::back_inserter(found),
               [&](const Reference& reference) { return reference.patient_id == patient_id; });
  return found;
}

std::optional<Reference> FakeAppliance::FindReference(const std::string& id) {
  return FindById(references, id);
}

RoomOnMap FakeAppliance::RoomOfReference(const Reference& reference) {
  if (reference.origin.source == ReferenceSource::kPlanningCt)  // in the axes of the room
    return {.gantry_xy = {0, 1}, .right_xy = {1, 0}, .is_known = true};
  return room_of_references.value_or(status.room);
}

void FakeAppliance::AddReference(const Actor& actor, const std::string& scan_id,
                                 const std::string& reason, Done done) {
  const auto scan = FindScan(scan_id);
  if (!scan || scan->outcome != ScanOutcome::kDone)
    return Finish(done, Refused(ChangeResult::kNotFound, "no finished scan of this id"));
  if (!status.reference_block.empty())
    return Finish(done, Refused(ChangeResult::kConflict, status.reference_block));
  Reference& draft = MakeReference(*scan, actor.user, reason);
  const std::string id = draft.id;
  if (const auto before = FindReference(scan->reference_id)) {
    draft.plan.posture = before->plan.posture;
    draft.plan.tolerance = before->plan.tolerance;
  }
  Did(actor, "reference.add", id, done, id);
}

void FakeAppliance::AddPlanning(const Actor& actor, const std::string& patient_id,
                                const web::SentPlanning& sent, Done done) {
  if (!FindPatient(patient_id))
    return Finish(done, Refused(ChangeResult::kNotFound, say::store::NoPatient()));
  sent_planning = sent;
  if (!sent.file.empty()) uploaded_bytes = std::filesystem::file_size(sent.file);
  std::filesystem::path folder;
  try {
    if (import_planning) folder = import_planning(sent);
  } catch (const DataError& error) {
    return Finish(done, Refused(ChangeResult::kInvalid, error.message()));
  }
  if (!planning_doubt.empty() && !sent.is_same_patient)
    return Finish(done, Refused(ChangeResult::kConflict, planning_doubt));
  if (!planning_doubt.empty() && sent.reason.empty())
    return Finish(done, Refused(ChangeResult::kConflict, say::store::PlanningNeedsReason()));
  Scan scan;
  scan.id = fmt::format("ct{:04}", next_id_++);
  scan.patient_id = patient_id;
  scan.purpose = ScanPurpose::kReference;
  scan.outcome = ScanOutcome::kDone;
  scan.started_at = WallClock::now();
  scan.folder = folder;
  scans.push_back(scan);
  Reference& draft = MakeReference(scan, actor.user, sent.reason);
  draft.plan.isocentre_m = {0, 0, 0};
  draft.origin.source = ReferenceSource::kPlanningCt;
  const std::string id = draft.id;
  Did(actor, "reference.add", id, done, id);
}

void FakeAppliance::ImportReceived(const Actor& actor, const std::string& patient_id,
                                   const web::ReceivedChoice& choice, Done done) {
  const auto is_there = [&](const std::string& name) {
    return std::ranges::any_of(received.files,
                               [&](const ReceivedFile& file) { return file.name == name; });
  };
  const bool has_series =
      choice.series.empty() || std::ranges::any_of(received.series, [&](const auto& one) {
        return one.uid == choice.series;
      });
  const bool has_structures = choice.structures.empty() || is_there(choice.structures);
  if (!has_structures || !has_series || !is_there(choice.plan))
    return Finish(done, Refused(ChangeResult::kNotFound, say::scan::NoReceivedFile()));
  web::SentPlanning sent;
  if (!choice.series.empty()) sent.threshold_hu = choice.threshold_hu;
  sent.roi = choice.roi;
  sent.beam = choice.beam;
  sent.reason = choice.reason;
  sent.is_same_patient = choice.is_same_patient;
  AddPlanning(actor, patient_id, sent, [this, choice, done](const Change& change) {
    for (ReceivedFile& file : received.files)
      if (change.result == ChangeResult::kDone &&
          (file.name == choice.structures || file.name == choice.plan))
        file.reference_id = change.id;
    done(change);
  });
}

void FakeAppliance::PlanReference(const Actor& actor, const std::string& id, int revision,
                                  const ReferencePlan& plan, Done done) {
  const auto found = std::find_if(references.begin(), references.end(),
                                  [&](const Reference& reference) { return reference.id == id; });
  if (found == references.end())
    return Finish(done, Refused(ChangeResult::kNotFound, "no such reference"));
  if (found->revision != revision)
    return Finish(done,
                  Refused(ChangeResult::kConflict, "this plan has been changed by somebody else"));
  if (found->approved_by.empty()) {
    found->plan = plan;
    ++found->revision;
    found->digest = fmt::format("digest of {} {}", id, found->revision);
    found->planned_by = actor.user;
    TellWaiting();
    return Did(actor, "reference.plan", id, done);
  }
  Reference next = *found;
  next.id = fmt::format("r{:04}", next_id_++);
  next.version = static_cast<int>(References(next.patient_id).size()) + 1;
  next.plan = plan;
  next.revision = 1;
  next.created_by = next.planned_by = actor.user;
  next.digest = "digest of " + next.id + " 1";
  next.approved_by.clear();
  next.approved_at.reset();
  references.push_back(next);
  TellWaiting();
  Did(actor, "reference.plan", next.id, done, next.id);
}

void FakeAppliance::ApproveReference(const Actor& actor, const std::string& id, int revision,
                                     const std::string& digest, const web::Considered& considered,
                                     Done done) {
  if (is_unreadable) throw IoError("version 2 of the reference: its plan cannot be read");
  const auto found = std::find_if(references.begin(), references.end(),
                                  [&](const Reference& reference) { return reference.id == id; });
  if (found == references.end())
    return Finish(done, Refused(ChangeResult::kNotFound, "no such reference"));
  if (!status.reference_block.empty())
    return Finish(done, Refused(ChangeResult::kConflict, status.reference_block));
  if (!found->approved_by.empty())
    return Finish(done, Refused(ChangeResult::kConflict, "this reference is approved already"));
  if (found->revision != revision)
    return Finish(done,
                  Refused(ChangeResult::kConflict, "this plan has been changed by somebody else"));
  if (!digest.empty() && digest != found->digest)
    return Finish(done, Refused(ChangeResult::kConflict, "what is stored is not what was shown"));
  if (found->planned_by.empty())
    return Finish(done, Refused(ChangeResult::kConflict,
                                "nobody has planned this reference: save its plan first"));
  if (found->created_by == actor.user || found->planned_by == actor.user) {
    return Finish(done,
                  Refused(ChangeResult::kRefused,
                          "a second person must approve: you made or planned this reference"));
  }
  if (const auto scan = FindScan(found->scan_id);
      scan && judge_quality && considered.reason.empty() && !judge_quality(*scan).cautions.empty())
    return Finish(done, Refused(ChangeResult::kConflict, say::store::ReferenceNeedsReason()));
  if (RoomOfReference(*found).contradicts_posture && !considered.posture)
    return Finish(done, Refused(ChangeResult::kConflict, say::store::ReferencePosture()));
  if (const auto scan = FindScan(found->scan_id); scan && skin_of_images && !considered.images)
    if (const std::optional<double> hu = skin_of_images(*scan))
      return Finish(done, Refused(ChangeResult::kConflict, say::store::ReferenceImages(*hu)));
  found->approved_by = actor.user;
  found->approved_at = WallClock::now();
  if (Patient* patient = PatientOf(found->patient_id)) patient->approved_reference_id = id;
  TellWaiting();
  TellNewerReference();
  Notify(EventKind::kStatus);
  Did(actor, "reference.approve", id, done);
}

std::vector<Scan> FakeAppliance::Scans(const std::string& patient_id, int limit) {
  std::vector<Scan> found;
  for (auto scan = scans.rbegin();
       scan != scans.rend() && found.size() < static_cast<std::size_t>(limit); ++scan) {
    if (patient_id.empty() || scan->patient_id == patient_id) found.push_back(*scan);
  }
  return found;
}

std::optional<Scan> FakeAppliance::FindScan(const std::string& id) { return FindById(scans, id); }

void FakeAppliance::RemoveScan(const Actor& actor, const std::string& id, const std::string&,
                               Done done) {
  for (const Reference& reference : references) {
    if (reference.scan_id == id)
      return Finish(done,
                    Refused(ChangeResult::kConflict, "this scan is the source of a reference"));
  }
  if (std::erase_if(scans, [&](const Scan& scan) { return scan.id == id; }) == 0)
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no such scan"));
  Notify(EventKind::kData);
  Did(actor, "scan.remove", id, done);
}

void FakeAppliance::AcceptScan(const Actor& actor, const std::string& id, const std::string& reason,
                               Done done) {
  const auto found =
      std::find_if(scans.begin(), scans.end(), [&](const Scan& scan) { return scan.id == id; });
  if (found == scans.end()) return Finish(done, Refused(ChangeResult::kNotFound, "no such scan"));
  const auto refuse = [&](const char* why) { Finish(done, Refused(ChangeResult::kConflict, why)); };
  if (status.scan) return refuse("a scan is running: accept its result, not an older one");
  if (!found->result || found->result->verdict == Verdict::kNoAnswer)
    return refuse("there is nothing to accept");
  if (IsOld(*found)) return refuse("this result is older than 2 minutes: scan again");
  if (!found->session_id.empty() && (!status.session || status.session->id != found->session_id))
    return refuse("only the newest result of the open session can be accepted");
  if (std::any_of(found + 1, scans.end(), [&](const Scan& scan) {
        return scan.patient_id == found->patient_id && scan.outcome == ScanOutcome::kDone;
      }))
    return refuse("there is a newer scan of this patient: accept that one");
  if (const Message why = QualityOf(id).why_not_accept; !why.empty())
    return Finish(done, Refused(ChangeResult::kConflict, why));
  if (found->result->verdict != Verdict::kInTolerance && reason.empty())
    return refuse("this result is not in tolerance: accepting it requires a reason");
  found->accepted_by = actor.user;
  found->accepted_reason = reason;
  found->accepted_at = WallClock::now();
  if (status.session && status.session->id == found->session_id)
    status.session->has_unaccepted = false;
  if (status.last_result && status.last_result->id == id) status.last_result = *found;
  Did(actor, reason.empty() ? "scan.accept" : "scan.accept_outside", id, done);
}

}  // namespace plumb::test
