// SPDX-License-Identifier: Apache-2.0
#include "daemon/received/received_files.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/plain_text.hpp"
#include "daemon/planning/patient_hash.hpp"
#include "daemon/unit/page_identity.hpp"
#include "drivers/dicom/planning_files.hpp"
#include "drivers/files/file_io.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMostListed = 100;
constexpr int kMostReadAtOnce = 8;  // each may take seconds
constexpr std::size_t kMostNoteBytes = 4096, kMostNotesBytes = std::size_t{1} << 20;
constexpr std::size_t kMostWord = 64;
constexpr const char* kCtImage = "1.2.840.10008.5.1.4.1.1.2";

/// Names are those of Spool::NewFile(); nothing else is opened, and no path.
bool IsOwnName(const std::string& name) {
  return !name.empty() && name.size() <= kMostWord && std::ranges::all_of(name, [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || c == '-';
  });
}

std::string WordIn(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string()
             ? AsPlainText(found->get<std::string>().substr(0, kMostWord))
             : std::string();
}

/// The note of plumb-dicomd; a damaged one leaves out what it does not say.
ReceivedFile FromNote(const fs::path& note, std::string& class_uid) {
  ReceivedFile file{.name = note.stem().string(), .is_read = false};
  try {
    const Json json = ParseBoundedJson<Json>(ReadTextFile(note, kMostNoteBytes));
    file.received_at = WordIn(json, "received_at");
    file.sender = WordIn(json, "calling_ae_title");
    file.address = WordIn(json, "address");
    class_uid = WordIn(json, "class_uid");
    if (json.contains("bytes") && json["bytes"].is_number_unsigned())
      file.bytes = json["bytes"].get<std::uint64_t>();
  } catch (const std::exception&) {
    // The file itself says what it is once it is read.
  }
  return file;
}

/// Newest first, by the time in the name.
std::vector<std::string> NamesIn(const fs::path& spool) {
  std::error_code error;
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(spool, error))
    if (entry.path().extension() == ".dcm" && IsOwnName(entry.path().stem().string()))
      names.push_back(entry.path().stem().string());
  if (error) throw IoError(say::scan::NoSpool(spool.string(), error.message()));
  std::ranges::sort(names, std::greater<>());
  return names;
}

}  // namespace

ReceivedFiles::ReceivedFiles(fs::path spool, fs::path notes, std::string key)
    : spool_(std::move(spool)), notes_(std::move(notes)), key_(std::move(key)) {}

void ReceivedFiles::Load() {
  if (std::exchange(is_loaded_, true)) return;
  std::error_code error;
  if (!fs::exists(notes_, error)) return;
  try {
    const Json json = ParseBoundedJson<Json>(ReadTextFile(notes_, kMostNotesBytes));
    for (const auto& [name, one] : json.at("files").items()) {
      if (!IsOwnName(name)) continue;
      known_[name] = {
          .kind = Named<ReceivedKind>(WordIn(one, "kind")).value_or(ReceivedKind::kOther),
          .instance_uid = WordIn(one, "instance_uid"),
          .structure_set_uid = WordIn(one, "structure_set_uid"),
          .label = WordIn(one, "label"),
          .patient_hash = one.at("patient_hash").get<std::string>(),
          .reference_id = WordIn(one, "reference_id"),
          .fault = MessageFromJson(one.at("fault"), WordIn(one, "fault_english"))};
    }
  } catch (const std::exception&) {
    known_.clear();  // the files are read again; only what became of them is not known any more
  }
}

void ReceivedFiles::Store() const {
  Json files = Json::object();
  for (const auto& [name, one] : known_)
    files[name] = {{"kind", Name(one.kind)},
                   {"instance_uid", one.instance_uid},
                   {"structure_set_uid", one.structure_set_uid},
                   {"label", one.label},
                   {"patient_hash", one.patient_hash},
                   {"reference_id", one.reference_id},
                   {"fault", MessageJson(one.fault)},
                   {"fault_english", one.fault.English()}};
  KeepSecret(notes_, Json{{"format", 1}, {"files", files}}.dump(-1, ' ', false,
                                                                Json::error_handler_t::replace));
}

ReceivedFiles::Known ReceivedFiles::ReadOne(const std::string& name) const {
  Known known;
  try {
    const PlanningContent content = ReadDicomFile(spool_ / (name + ".dcm"), "DICOM");
    known.instance_uid = content.file.instance_uid;
    known.label = AsPlainText(content.file.label.substr(0, kMostWord));
    known.patient_hash = PatientHash(key_, content.file.patient_id);
    if (content.structures) known.kind = ReceivedKind::kStructures;
    if (content.plan) {
      known.kind = ReceivedKind::kPlan;
      known.structure_set_uid = content.plan->structure_set_uid;
    }
  } catch (const DataError& error) {
    known.fault = error.message();
  }
  return known;
}

ReceivedFiles::Listing ReceivedFiles::List() {
  const std::lock_guard lock(mutex_);
  Load();
  Listing listing;
  const std::vector<std::string> names = NamesIn(spool_);
  const auto before = known_.size();
  std::erase_if(known_, [&](const auto& one) {
    return !std::ranges::binary_search(names, one.first, std::greater<>());
  });
  bool is_changed = known_.size() != before;
  int num_read = 0;
  for (const std::string& name : names) {
    std::string class_uid;
    ReceivedFile file = FromNote(spool_ / (name + ".json"), class_uid);
    if (class_uid == kCtImage) {
      ++listing.images;
      continue;
    }
    if (listing.entries.size() >= kMostListed) {
      ++listing.unlisted;
      continue;
    }
    auto known = known_.find(name);
    if (known == known_.end() && num_read < kMostReadAtOnce) {
      ++num_read;
      is_changed = true;
      known = known_.emplace(name, ReadOne(name)).first;
    }
    if (known != known_.end()) {
      const Known& facts = known->second;
      file.is_read = true;
      file.kind = facts.kind;
      file.label = facts.label;
      file.reference_id = facts.reference_id;
      file.fault = facts.fault;
      listing.entries.push_back({std::move(file), facts.patient_hash});
    } else {
      listing.entries.push_back({std::move(file), {}});
    }
  }
  JoinPlans(listing);
  if (is_changed) Store();
  return listing;
}

void ReceivedFiles::JoinPlans(Listing& listing) const {
  std::map<std::string, std::string> newest;  // structure set of each instance
  for (const Entry& entry : listing.entries)
    if (entry.file.kind == ReceivedKind::kStructures)
      newest.emplace(known_.at(entry.file.name).instance_uid, entry.file.name);
  for (Entry& entry : listing.entries) {
    if (entry.file.kind != ReceivedKind::kPlan) continue;
    const auto found = newest.find(known_.at(entry.file.name).structure_set_uid);
    if (found != newest.end()) entry.file.structures = found->second;
  }
}

fs::path ReceivedFiles::PathOf(const std::string& name) const {
  std::error_code error;
  const fs::path file = spool_ / (name + ".dcm");
  if (!IsOwnName(name) || !fs::is_regular_file(file, error))
    throw DataError(say::scan::NoReceivedFile());
  return file;
}

void ReceivedFiles::NoteReference(const std::vector<std::string>& names,
                                  const std::string& reference_id) {
  const std::lock_guard lock(mutex_);
  Load();
  for (const std::string& name : names) {
    if (!known_.contains(name)) known_[name] = ReadOne(name);
    known_[name].reference_id = reference_id;
  }
  Store();
}

}  // namespace plumb
