// SPDX-License-Identifier: Apache-2.0
#include "daemon/received/received_images.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/plain_text.hpp"
#include "daemon/planning/patient_hash.hpp"
#include "drivers/dicom/planning_files.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostUid = 64;

std::string Uid(const std::string& stated) { return AsPlainText(stated.substr(0, kMostUid)); }

}  // namespace

bool ReceivedImages::Keep(const std::vector<Image>& images) {
  std::set<std::string> names;
  for (const Image& image : images) names.insert(image.name);
  const std::size_t before = series_of_.size();
  std::erase_if(series_of_, [&](const auto& one) { return !names.contains(one.first); });
  std::set<std::string> kept;
  for (const auto& [name, series] : series_of_) kept.insert(series);
  std::erase_if(facts_, [&](const auto& one) { return !kept.contains(one.first); });
  if (num_damaged() == 0) fault_ = {};
  return series_of_.size() != before;
}

void ReceivedImages::Read(const std::filesystem::path& spool, const std::string& name) {
  std::string series;
  Facts facts;
  try {
    const CtImage image = ReadCtImage(spool / (name + ".dcm"), name);
    series = Uid(image.series_uid);
    facts = {.frame_uid = Uid(image.file.frame_of_reference_uid),
             .patient_hash = PatientHash(key_, image.file.patient_id)};
  } catch (const DataError& error) {
    fault_ = error.message();
  }
  // The image counts as known only from here on, so that it is read again after any other error.
  if (!series.empty()) facts_.try_emplace(series, std::move(facts));
  series_of_[name] = std::move(series);
}

std::vector<ReceivedImages::Series> ReceivedImages::SeriesOf(
    const std::vector<Image>& images) const {
  std::vector<Series> all;
  std::set<std::string> seen;
  for (const Image& image : images) {
    const auto known = series_of_.find(image.name);
    if (known == series_of_.end() || known->second.empty()) continue;
    const std::string& uid = known->second;
    auto found = std::ranges::find_if(all, [&](const Series& one) { return one.facts.uid == uid; });
    if (found == all.end()) {
      const Facts& facts = facts_.at(uid);
      all.push_back({.facts = {.uid = uid,
                               .frame_uid = facts.frame_uid,
                               .received_at = image.received_at,
                               .sender = image.sender,
                               .address = image.address},
                     .patient_hash = facts.patient_hash});
      found = std::prev(all.end());
    }
    const bool is_new = image.instance_uid.empty() || seen.insert(image.instance_uid).second;
    found->facts.images += is_new ? 1 : 0;
  }
  return all;
}

std::vector<std::string> ReceivedImages::Of(const std::string& series,
                                            const std::vector<Image>& images) const {
  std::vector<std::string> names;
  std::set<std::string> seen;
  for (const Image& image : images) {
    const auto known = series_of_.find(image.name);
    if (known == series_of_.end() || known->second != series || series.empty()) continue;
    if (image.instance_uid.empty() || seen.insert(image.instance_uid).second)
      names.push_back(image.name);
  }
  return names;
}

int ReceivedImages::num_damaged() const {
  return static_cast<int>(
      std::ranges::count_if(series_of_, [](const auto& one) { return one.second.empty(); }));
}

Json ReceivedImages::ToJson() const {
  Json json = {{"series", Json::object()}, {"names", Json::object()}};
  std::map<std::string, int> numbers;  // a UID is longer than its number
  for (const auto& [uid, facts] : facts_) {
    const int number = static_cast<int>(numbers.size());
    numbers[uid] = number;
    json["series"][uid] = {
        {"number", number}, {"frame_uid", facts.frame_uid}, {"patient_hash", facts.patient_hash}};
  }
  for (const auto& [name, uid] : series_of_)
    json["names"][name] = uid.empty() ? -1 : numbers.at(uid);
  json["fault"] = MessageJson(fault_);
  json["fault_english"] = fault_.English();
  return json;
}

void ReceivedImages::FromJson(const Json& json) {
  std::map<int, std::string> uids;
  for (const auto& [uid, one] : json.at("series").items()) {
    facts_[Uid(uid)] = {.frame_uid = Uid(one.at("frame_uid").get<std::string>()),
                        .patient_hash = one.at("patient_hash").get<std::string>()};
    uids[one.at("number").get<int>()] = Uid(uid);
  }
  for (const auto& [name, number] : json.at("names").items())
    series_of_[name] = number.get<int>() < 0 ? std::string() : uids.at(number.get<int>());
  fault_ = MessageFromJson(json.at("fault"), json.at("fault_english").get<std::string>());
}

}  // namespace plumb
