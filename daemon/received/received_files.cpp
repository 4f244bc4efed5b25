// SPDX-License-Identifier: Apache-2.0
#include "daemon/received/received_files.hpp"

#include <algorithm>
#include <chrono>
#include <functional>
#include <utility>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/plain_text.hpp"
#include "algo/planning/plan_choices.hpp"
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

/// What the note says beside what a page shows.
struct Uids {
  std::string of_class, of_instance;
};

/// The note of plumb-dicomd; a damaged one leaves out what it does not say.
ReceivedFile FromNote(const fs::path& note, Uids& uids) {
  ReceivedFile file{.name = note.stem().string(), .is_read = false};
  try {
    const Json json = ParseBoundedJson<Json>(ReadTextFile(note, kMostNoteBytes));
    file.received_at = WordIn(json, "received_at");
    file.sender = WordIn(json, "calling_ae_title");
    file.address = WordIn(json, "address");
    uids = {.of_class = WordIn(json, "class_uid"), .of_instance = WordIn(json, "instance_uid")};
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

ReceivedFiles::ReceivedFiles(fs::path spool, fs::path notes, std::string key,
                             std::chrono::milliseconds reading_images)
    : spool_(std::move(spool)),
      notes_(std::move(notes)),
      key_(std::move(key)),
      reading_images_(reading_images),
      images_(key_) {}

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
          .frame_uid = WordIn(one, "frame_uid"),
          .has_skin = one.value("has_skin", false),
          .is_stale = !one.contains("frame_uid"),
          .fault = MessageFromJson(one.at("fault"), WordIn(one, "fault_english"))};
    }
    if (json.contains("images")) images_.FromJson(json["images"]);
  } catch (const std::exception&) {
    images_ = ReceivedImages(key_);
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
                   {"frame_uid", one.frame_uid},
                   {"has_skin", one.has_skin},
                   {"fault", MessageJson(one.fault)},
                   {"fault_english", one.fault.English()}};
  const Json json = {{"format", 1}, {"files", files}, {"images", images_.ToJson()}};
  KeepSecret(notes_, json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

ReceivedFiles::Known ReceivedFiles::ReadOne(const std::string& name) const {
  Known known;
  try {
    const PlanningContent content = ReadDicomFile(spool_ / (name + ".dcm"), "DICOM");
    known.instance_uid = content.file.instance_uid;
    known.label = AsPlainText(content.file.label.substr(0, kMostWord));
    known.patient_hash = PatientHash(key_, content.file.patient_id);
    if (content.structures) {
      known.kind = ReceivedKind::kStructures;
      known.has_skin = HasExternal(*content.structures);
    }
    if (content.plan) {
      known.kind = ReceivedKind::kPlan;
      known.frame_uid = AsPlainText(content.file.frame_of_reference_uid.substr(0, kMostWord));
      known.structure_set_uid = content.plan->structure_set_uid;
    }
  } catch (const DataError& error) {
    known.fault = error.message();
  }
  return known;
}

ReceivedFiles::Found ReceivedFiles::Look() const {
  Found found;
  for (const std::string& name : NamesIn(spool_)) {
    Uids uids;
    ReceivedFile file = FromNote(spool_ / (name + ".json"), uids);
    if (uids.of_class == kCtImage) {
      ++found.num_images;
      if (found.images.size() < ReceivedImages::kMost)
        found.images.push_back({.name = name,
                                .instance_uid = uids.of_instance,
                                .received_at = file.received_at,
                                .sender = file.sender,
                                .address = file.address});
    } else if (found.files.size() < kMostListed) {
      found.files.push_back(std::move(file));
    } else {
      ++found.unlisted;
    }
  }
  return found;
}

bool ReceivedFiles::IsRead(const std::string& name) const {
  const auto known = known_.find(name);
  return known != known_.end() && !known->second.is_stale;
}

void ReceivedFiles::ReadSome(const Found& found) {
  using Steady = std::chrono::steady_clock;
  const auto is_gone = [&](const auto& one) {
    std::error_code error;
    return !fs::exists(spool_ / (one.first + ".dcm"), error) && !error;
  };
  bool is_changed = std::erase_if(known_, is_gone) > 0;
  is_changed = images_.Keep(found.images) || is_changed;
  int num_read = 0;
  for (const ReceivedFile& file : found.files) {
    if (IsRead(file.name) || num_read == kMostReadAtOnce) continue;
    ++num_read;
    Known known = ReadOne(file.name);
    if (const auto before = known_.find(file.name); before != known_.end())
      known.reference_id = before->second.reference_id;
    known_[file.name] = std::move(known);
  }
  // The oldest first: those of a series that has come as a whole must not wait for the next one.
  const auto until = Steady::now() + reading_images_;
  for (auto image = found.images.rbegin(); image != found.images.rend(); ++image) {
    if (images_.IsKnown(image->name)) continue;
    images_.Read(spool_, image->name);
    is_changed = true;
    if (Steady::now() >= until) break;
  }
  if (is_changed || num_read > 0) Store();
}

ReceivedFiles::Listing ReceivedFiles::List() {
  const std::lock_guard lock(mutex_);
  Load();
  Found found = Look();
  ReadSome(found);
  Listing listing{
      .entries = {},
      .series = images_.SeriesOf(found.images),
      .images = found.num_images,
      .unlisted = found.unlisted + found.num_images - static_cast<int>(found.images.size()),
      .damaged_images = images_.num_damaged(),
      .image_fault = images_.fault()};
  for (const auto& image : found.images) listing.unread += images_.IsKnown(image.name) ? 0 : 1;
  for (ReceivedFile& file : found.files) {
    Entry entry{.file = std::move(file), .patient_hash = {}};
    if (IsRead(entry.file.name)) {
      const Known& facts = known_.at(entry.file.name);
      entry.file.is_read = true;
      entry.file.kind = facts.kind;
      entry.file.label = facts.label;
      entry.file.reference_id = facts.reference_id;
      entry.file.fault = facts.fault;
      entry.file.has_skin = facts.has_skin;
      entry.patient_hash = facts.patient_hash;
    } else {
      ++listing.unread;
    }
    listing.entries.push_back(std::move(entry));
  }
  JoinPlans(listing);
  return listing;
}

void ReceivedFiles::JoinPlans(Listing& listing) const {
  std::map<std::string, const Entry*> newest;  // structure set of each instance
  for (const Entry& entry : listing.entries)
    if (entry.file.kind == ReceivedKind::kStructures)
      newest.emplace(known_.at(entry.file.name).instance_uid, &entry);
  for (Entry& entry : listing.entries) {
    if (entry.file.kind != ReceivedKind::kPlan) continue;
    const Known& plan = known_.at(entry.file.name);
    if (const auto found = newest.find(plan.structure_set_uid); found != newest.end()) {
      entry.file.structures = found->second->file.name;
      entry.file.has_skin = found->second->file.has_skin;
    }
    for (const ReceivedImages::Series& series : listing.series)
      if (!plan.frame_uid.empty() && series.facts.frame_uid == plan.frame_uid)
        entry.file.series.push_back(series.facts.uid);
  }
}

ReceivedFiles::SeriesFiles ReceivedFiles::ImagesOf(const std::string& series) {
  const std::lock_guard lock(mutex_);
  Load();
  const Found found = Look();
  ReadSome(found);
  SeriesFiles chosen;
  if (const int beyond = found.num_images - static_cast<int>(found.images.size()); beyond > 0) {
    chosen.why_not =
        say::scan::ImagesTooMany(found.num_images, static_cast<std::int64_t>(found.images.size()));
    return chosen;
  }
  for (const std::string& name : images_.Of(series, found.images))
    chosen.files.push_back(PathOf(name));
  chosen.why_not = WhyNotWhole(chosen.files, found.images);
  if (chosen.why_not.empty() && chosen.files.empty()) throw DataError(say::scan::NoReceivedFile());
  return chosen;
}

Message ReceivedFiles::WhyNotWhole(const std::vector<fs::path>& files,
                                   const std::vector<ReceivedImages::Image>& images) const {
  // An image that came later than this belongs to another transmission.
  const auto end =
      files.empty() ? fs::file_time_type::max() : fs::last_write_time(files.front()) + kSeriesPause;
  for (const ReceivedImages::Image& image : images)
    if (!images_.IsKnown(image.name) && fs::last_write_time(spool_ / (image.name + ".dcm")) < end)
      return say::scan::ImagesBeingRead();
  const auto now = fs::file_time_type::clock::now();
  // A clock that was set back since must not hold it up for longer.
  const bool is_arriving = !files.empty() && now < end && now > end - 2 * kSeriesPause;
  return is_arriving ? say::scan::ImagesArriving() : Message();
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
