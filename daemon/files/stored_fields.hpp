// SPDX-License-Identifier: Apache-2.0
// Writes and reads the JSON files of scenes and results, both from one list of fields for each
// type: T::Fields(self, visit), or StoredFields<T> for types of the method, which know nothing of
// files. The visitor is a FieldWriter or a FieldReader.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/names.hpp"
#include "algo/base/parse_number.hpp"
#include "algo/verdict/gates.hpp"
#include "words/stored_file.hpp"

namespace plumb::stored {

using Json = nlohmann::ordered_json;

/// Fields of a type that knows nothing of files.
template <typename T>
struct StoredFields;

/// Limits for each number in a value; least == most: no limits, and null is permitted.
struct Bounds {
  double least = 0.0, most = 0.0;
};

template <typename T>
inline constexpr bool kIsOptional = false;
template <typename T>
inline constexpr bool kIsOptional<std::optional<T>> = true;

/// An object's entries, kept in the order of the file.
template <typename T>
inline constexpr bool kIsEntries = false;
template <typename T>
inline constexpr bool kIsEntries<std::vector<std::pair<std::string, T>>> = true;

template <typename T>
inline constexpr bool kIsList = false;
template <typename T>
inline constexpr bool kIsList<std::vector<T>> = true;

template <typename T>
concept NamedEnum = std::is_enum_v<T> && !kNamesOf<T>.empty();
template <typename T>
concept Matrix = requires {
  T::RowsAtCompileTime;
};
template <typename T>
inline constexpr bool kIsArray = false;
template <typename T, std::size_t N>
inline constexpr bool kIsArray<std::array<T, N>> = true;
/// The six numbers, or something for each of them.
template <typename T>
concept OfNumbers = kIsArray<T> && std::tuple_size_v<T>
== 6;
/// The values of the six numbers; unknown ones are not set.
template <typename T>
concept SixValues = OfNumbers<T> && kIsOptional<typename T::value_type>;

inline std::string NumberKey(std::size_t number) {
  return fmt::format("{}_{}", kNumberNames.at(number), UnitOf(number));
}

/// Calls visit(key, value) for each of the six; the keys of numbers end in their unit.
template <typename Values, typename Visit>
void ForEachNumber(Values& values, const Visit& visit) {
  for (std::size_t i = 0; i < values.size(); ++i)
    visit(SixValues<std::remove_const_t<Values>> ? NumberKey(i) : std::string(kNumberNames.at(i)),
          values[i]);
}

// ---- Writing

template <typename T>
Json Written(const T& value);

class FieldWriter {
 public:
  explicit FieldWriter(Json& json) : json_(json) {}

  template <typename T>
  void operator()(const char* key, const T& value, const Bounds& = {}) const {
    if constexpr (std::is_same_v<T, Message>) {
      // The English words for readers that know no messages, and the message beside them.
      json_[key] = value.empty() ? Json(nullptr) : Json(value.English());
      json_[fmt::format("{}_message", key)] = value.empty() ? Json(nullptr) : MessageJson(value);
    } else {
      json_[key] = Written(value);
    }
  }
  /// If the file lacks the key, a reader leaves the value unchanged.
  template <typename T>
  void OrAsIs(const char* key, const T& value, const Bounds& = {}) const {
    json_[key] = Written(value);
  }
  /// Left out if it is not set.
  template <typename T>
  void IfSet(const char* key, const std::optional<T>& value, const Bounds& = {}) const {
    if (value) json_[key] = Written(*value);
  }
  /// A message that is written as an empty text if there is none.
  void Text(const char* key, const Message& value) const {
    json_[key] = value.English();
    if (!value.empty()) json_[fmt::format("{}_message", key)] = MessageJson(value);
  }
  void Sentences(const char* key, const char* messages, const std::vector<Message>& value) const {
    json_[key] = EnglishTexts(value);
    json_[messages] = MessagesJson(value);
  }
  /// As Sentences(), but a file may lack them.
  void SentencesOrNone(const char* key, const char* messages,
                       const std::vector<Message>& value) const {
    Sentences(key, messages, value);
  }
  /// One member of each entry, as an object whose keys are the entries' numbers.
  template <typename T, typename Member>
  void OfEach(const char* key, const std::map<int, T>& entries, Member T::*member,
              const Bounds& = {}) const {
    json_[key] = Json::object();
    for (const auto& [id, entry] : entries) json_[key][std::to_string(id)] = Written(entry.*member);
  }
  template <typename T, typename Member>
  void OfEachOrAsIs(const char* key, const std::map<int, T>& entries, Member T::*member,
                    const Bounds& = {}) const {
    OfEach(key, entries, member);
  }
  /// Written into this object itself, without a key of their own.
  void Numbers(const SixValues auto& value) const { json_.update(Written(value)); }
  void NumberWords(const char* key, const char* messages,
                   const std::array<Message, 6>& value) const {
    ForEachNumber(value, [&](const std::string& number, const Message& words) {
      json_[key][number] = words.English();
    });
    ForEachNumber(value, [&](const std::string& number, const Message& words) {
      json_[messages][number] = words.empty() ? Json(nullptr) : MessageJson(words);
    });
  }

 private:
  Json& json_;
};

template <typename T>
Json Written(const T& value) {
  if constexpr (kIsOptional<T>) {
    return value ? Written(*value) : Json(nullptr);
  } else if constexpr (NamedEnum<T>) {
    return Name(value);
  } else if constexpr (Matrix<T>) {
    Json rows = Json::array();
    for (Eigen::Index r = 0; r < value.rows(); ++r) {
      if constexpr (T::IsVectorAtCompileTime) {
        rows.push_back(value(r));
      } else {
        rows.push_back(Written(Eigen::Matrix<double, T::ColsAtCompileTime, 1>(value.row(r))));
      }
    }
    return rows;
  } else if constexpr (OfNumbers<T>) {
    Json json = Json::object();
    ForEachNumber(value,
                  [&](const std::string& key, const auto& one) { json[key] = Written(one); });
    return json;
  } else if constexpr (kIsEntries<T>) {
    Json json = Json::object();
    for (const auto& [key, one] : value) json[key] = Written(one);
    return json;
  } else if constexpr (requires { typename T::mapped_type; }) {
    Json json = Json::object();
    for (const auto& [key, one] : value) json[key] = one;
    return json;
  } else if constexpr (kIsList<T> || kIsArray<T>) {
    Json list = Json::array();
    for (const auto& one : value) list.push_back(Written(one));
    return list;
  } else if constexpr (requires { T::Fields(value, std::declval<const FieldWriter&>()); }) {
    Json json = Json::object();
    T::Fields(value, FieldWriter(json));
    return json;
  } else if constexpr (requires { sizeof(StoredFields<T>); }) {
    Json json = Json::object();
    StoredFields<T>::Fields(value, FieldWriter(json));
    return json;
  } else {
    return value;
  }
}

// ---- Reading

/// A value of the document, with its place for messages.
struct Found {
  const Json& json;
  std::string where;
  const Message& remedy;  ///< How to remake the file, such as "compare again".
  Bounds bounds = {};

  [[nodiscard]] Found Inside(const Json& inside, std::string place) const {
    return {inside, std::move(place), remedy, bounds};
  }
  [[noreturn]] void Fail(const Message& expected) const {
    constexpr std::size_t kMost = 40;
    const std::string found =
        json.dump(-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace);
    const std::string place = where.ends_with(": ") ? where.substr(0, where.size() - 2) : where;
    throw DataError(say::stored_file::Wrong(place, found.substr(0, kMost), expected, remedy));
  }
};

template <typename T>
void Read(const Found& found, T& value);

/// Calls visit(key, value) for each entry of an object.
template <typename Visit>
void ForEachEntry(const Found& found, const Visit& visit) {
  if (!found.json.is_object()) found.Fail(say::stored_file::Object());
  for (const auto& [key, one] : found.json.items())
    visit(key, found.Inside(one, fmt::format("{}.{}", found.where, key.substr(0, 40))));
}

class FieldReader {
 public:
  explicit FieldReader(const Found& object) : object_(object) {
    if (!object.json.is_object()) object.Fail(say::stored_file::Object());
  }

  template <typename T>
  void operator()(const char* key, T& value, const Bounds& bounds = {}) const {
    if constexpr (std::is_same_v<T, Message>) {
      const Json* const found = Find(key);
      if (found != nullptr && !found->is_null() && !found->is_string())
        At(key, *found).Fail(say::stored_file::Text());
      value = found == nullptr || found->is_null()
                  ? Message()
                  : Said(*found, Find(fmt::format("{}_message", key)));
    } else if constexpr (std::is_same_v<T, NumberJudgements>) {
      // New in 0.3.0; where they are missing, they are decided afterwards.
      OrAsIs(key, value);
    } else {
      const Json* const found = Find(key);
      if (found != nullptr) return Read(At(key, *found, bounds), value);
      if constexpr (kIsOptional<T>) {
        value.reset();
      } else if constexpr (!SixValues<T>) {
        FailMissing(key);
      }
    }
  }
  template <typename T>
  void OrAsIs(const char* key, T& value, const Bounds& bounds = {}) const {
    if (const Json* const found = Find(key)) Read(At(key, *found, bounds), value);
  }
  template <typename T>
  void IfSet(const char* key, std::optional<T>& value, const Bounds& bounds = {}) const {
    (*this)(key, value, bounds);
  }
  void Text(const char* key, Message& value) const { (*this)(key, value); }
  void Sentences(const char* key, const char* messages, std::vector<Message>& value) const {
    std::vector<std::string> english;
    (*this)(key, english);
    const Json* const told = Find(messages);
    value = MessagesFromJson(told == nullptr ? Json() : *told, english);
  }
  void SentencesOrNone(const char* key, const char* messages, std::vector<Message>& value) const {
    if (Find(key) != nullptr) Sentences(key, messages, value);
  }
  /// Creates the entries.
  template <typename T, typename Member>
  void OfEach(const char* key, std::map<int, T>& entries, Member T::*member,
              const Bounds& bounds = {}) const {
    const Json* const found = Find(key);
    if (found == nullptr) FailMissing(key);
    ForEachEntry(At(key, *found, bounds), [&](const std::string& name, const Found& one) {
      const std::optional<int> id = ParseNumber<int>(name);
      if (!id || *id < 0 || *id > kMostId)
        throw DataError(say::stored_file::NoId(one.where, kMostId, one.remedy));
      Read(one, entries[*id].*member);
    });
  }
  /// For the entries that OfEach() created.
  template <typename T, typename Member>
  void OfEachOrAsIs(const char* key, std::map<int, T>& entries, Member T::*member,
                    const Bounds& bounds = {}) const {
    const Json* const found = Find(key);
    if (found == nullptr) return;
    ForEachEntry(At(key, *found, bounds), [&](const std::string& name, const Found& one) {
      const std::optional<int> id = ParseNumber<int>(name);
      const auto entry = id ? entries.find(*id) : entries.end();
      if (entry == entries.end()) throw DataError(say::stored_file::OfNone(one.where, one.remedy));
      Read(one, entry->second.*member);
    });
  }
  void Numbers(SixValues auto& value) const { Read(object_, value); }
  void NumberWords(const char* key, const char* messages, std::array<Message, 6>& value) const {
    std::map<std::string, std::string> english;
    (*this)(key, english);
    const Json* const told = Find(messages);
    ForEachNumber(value, [&](const std::string& number, Message& words) {
      const bool is_told = told != nullptr && told->is_object() && told->contains(number);
      words = MessageFromJson(is_told ? (*told)[number] : Json(), english[number]);
    });
  }

 private:
  static constexpr int kMostId = 65535;

  [[nodiscard]] const Json* Find(const std::string& key) const {
    const auto found = object_.json.find(key);
    return found == object_.json.end() ? nullptr : &*found;
  }
  [[nodiscard]] std::string Where(const std::string& key) const {
    return fmt::format("{}{}{}", object_.where, object_.where.ends_with(' ') ? "" : ".", key);
  }
  [[nodiscard]] Found At(const std::string& key, const Json& json,
                         const Bounds& bounds = {}) const {
    return {json, Where(key), object_.remedy, bounds};
  }
  [[noreturn]] void FailMissing(const std::string& key) const {
    throw DataError(say::stored_file::Missing(Where(key), object_.remedy));
  }
  static Message Said(const Json& english, const Json* message) {
    return MessageFromJson(message == nullptr ? Json() : *message,
                           english.get_ref<const std::string&>());
  }

  const Found& object_;
};

inline void RequireList(const Found& found, Eigen::Index size) {
  if (!found.json.is_array() || found.json.size() != static_cast<std::size_t>(size))
    found.Fail(say::stored_file::ListOf(size));
}

inline void RequireWithin(const Found& found, double value) {
  const auto& [least, most] = found.bounds;
  if (least < most && !(value >= least && value <= most))
    found.Fail(say::stored_file::NumberFrom(least, most));
}

inline double ReadNumber(const Found& found) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (!found.json.is_null() && !found.json.is_number()) found.Fail(say::stored_file::Number());
  const double value = found.json.is_null() ? kNone : found.json.get<double>();
  RequireWithin(found, value);
  return value;
}

template <Matrix T>
void ReadMatrix(const Found& found, T& value) {
  RequireList(found, value.rows());
  for (Eigen::Index r = 0; r < value.rows(); ++r) {
    const Found row = found.Inside(found.json[static_cast<std::size_t>(r)],
                                   fmt::format("{}[{}]", found.where, r));
    if constexpr (T::IsVectorAtCompileTime) {
      value(r) = ReadNumber(row);
    } else {
      Eigen::Matrix<double, T::ColsAtCompileTime, 1> values;
      ReadMatrix(row, values);
      value.row(r) = values.transpose();
    }
  }
}

template <typename T>
void ReadList(const Found& found, T& value) {
  if constexpr (kIsArray<T>) {
    RequireList(found, std::tuple_size_v<T>);
  } else {
    if (!found.json.is_array()) found.Fail(say::stored_file::List());
    value.resize(found.json.size());
  }
  for (std::size_t i = 0; i < value.size(); ++i)
    Read(found.Inside(found.json[i], fmt::format("{}[{}]", found.where, i)), value[i]);
}

template <typename T>
void ReadInteger(const Found& found, T& value) {
  const Json& json = found.json;
  const bool fits = json.is_number_unsigned()
                        ? std::in_range<T>(json.get<std::uint64_t>())
                        : json.is_number_integer() && std::in_range<T>(json.get<std::int64_t>());
  if (!fits) found.Fail(say::stored_file::WholeNumber());
  value = json.get<T>();
  RequireWithin(found, static_cast<double>(value));
}

template <typename T>
void Read(const Found& found, T& value) {
  const Json& json = found.json;
  if constexpr (kIsOptional<T>) {
    if (json.is_null()) return value.reset();
    Read(found, value.emplace());
  } else if constexpr (NamedEnum<T>) {
    const auto named =
        json.is_string() ? Named<T>(json.get_ref<const std::string&>()) : std::nullopt;
    if (!named) found.Fail(say::stored_file::OneOf({kNamesOf<T>.begin(), kNamesOf<T>.end()}));
    value = *named;
  } else if constexpr (Matrix<T>) {
    ReadMatrix(found, value);
  } else if constexpr (std::is_same_v<T, double>) {
    value = ReadNumber(found);
  } else if constexpr (std::is_same_v<T, bool>) {
    if (!json.is_boolean()) found.Fail(say::stored_file::Flag());
    value = json.get<bool>();
  } else if constexpr (std::is_integral_v<T>) {
    ReadInteger(found, value);
  } else if constexpr (std::is_same_v<T, std::string>) {
    if (!json.is_string()) found.Fail(say::stored_file::Text());
    value = json.get<std::string>();
  } else if constexpr (OfNumbers<T>) {
    if (!json.is_object()) found.Fail(say::stored_file::Object());
    ForEachNumber(value, [&](const std::string& key, auto& one) {
      const auto at = json.find(key);
      if (at != json.end()) Read(found.Inside(*at, fmt::format("{}.{}", found.where, key)), one);
    });
  } else if constexpr (kIsEntries<T>) {
    ForEachEntry(found, [&](const std::string& key, const Found& one) {
      Read(one, value.emplace_back(key, typename T::value_type::second_type()).second);
    });
  } else if constexpr (requires { typename T::mapped_type; }) {
    ForEachEntry(found, [&](const std::string& key, const Found& one) { Read(one, value[key]); });
  } else if constexpr (kIsList<T> || kIsArray<T>) {
    ReadList(found, value);
  } else if constexpr (requires { T::Fields(value, std::declval<const FieldReader&>()); }) {
    T::Fields(value, FieldReader(found));
  } else {
    StoredFields<T>::Fields(value, FieldReader(found));
  }
}

}  // namespace plumb::stored
