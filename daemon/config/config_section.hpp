// SPDX-License-Identifier: Apache-2.0
// One table of a configuration file: values are taken key by key, with line numbers in every error
// message.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/names.hpp"
#include "algo/base/nearest_name.hpp"
#include "algo/base/plain_text.hpp"
#include "daemon/config/toml.hpp"
#include "words/config.hpp"

namespace plumb {

/// @param name  Name of the file for messages. @throws DataError naming file and line.
[[nodiscard]] toml::table ParseToml(const std::string& text, const std::string& name);

/// @param known  Names of the tables that the file may have. @throws DataError naming file and
/// line.
inline void RejectUnknownTables(const toml::table& root, const std::string& file,
                                std::initializer_list<std::string_view> known) {
  for (const auto& [key, node] : root) {
    if (std::find(known.begin(), known.end(), key.str()) != known.end()) continue;
    std::vector<std::string> tables;
    for (const std::string_view name : known) tables.push_back(fmt::format("[{}]", name));
    throw DataError(
        say::config::UnknownTable(file, node.source().begin.line, key.str(), std::move(tables)));
  }
}

/// Keys that were not consumed are unknown, and refused. All functions throw DataError.
class Section {
 public:
  Section(const toml::table& root, std::string name, const std::string& file)
      : name_(std::move(name)), file_(file) {
    const toml::node* node = root.get(name_);
    if (node == nullptr) return;
    table_ = node->as_table();
    if (table_ == nullptr) Fail(*node, name_, say::config::ExpectedTable(name_));
  }

  template <typename T, typename Check>
  void Take(std::string_view key, T& value, const Message& expected, Check is_valid) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    std::optional<T> found;
    if constexpr (std::floating_point<T>) {
      if (node->is_number()) found = node->value<double>();
    } else if constexpr (std::integral<T> && !std::same_as<T, bool>) {
      if (const std::optional<std::int64_t> number = node->value_exact<std::int64_t>();
          number && std::in_range<T>(*number))
        found = static_cast<T>(*number);
    } else {
      found = node->value_exact<T>();
    }
    if (!found || !is_valid(*found)) Fail(*node, key, expected);
    if constexpr (std::same_as<T, std::string>)
      if (!IsPlainText(*found)) Fail(*node, key, say::config::ExpectedPlainText());
    value = *found;
  }

  /// The same for an optional key, without which the value stays unchanged.
  template <typename T, typename Check>
  void Take(std::string_view key, std::optional<T>& value, const Message& expected,
            Check is_valid) {
    T found{};
    if (Find(key) == nullptr) return;
    Take(key, found, expected, is_valid);
    value = found;
  }

  void TakeFlag(std::string_view key, bool& value) {
    Take(key, value, say::config::ExpectedFlag(), [](bool) { return true; });
  }

  void TakePath(std::string_view key, std::filesystem::path& path) {
    std::string text;
    Take(key, text, say::config::ExpectedAbsolutePath(),
         [](const std::string& s) { return s.starts_with('/') && s.size() < 4096; });
    if (!text.empty()) path = text;
  }

  /// A number in a range, with the name of its unit.
  void TakeNumber(std::string_view key, double& value, double least, double most,
                  const Message& unit) {
    Take(key, value, say::config::ExpectedRange(unit, least, most),
         [&](double v) { return v >= least && v <= most; });
  }

  /// A limit above 0 that may not exceed `most`.
  /// @param value  Like `most` in the unit inside the program, of which the file's is `unit`.
  void TakeLimit(std::string_view key, double& value, double most, double unit,
                 const Message& unit_name) {
    double number = 0.0;
    Take(key, number, say::config::ExpectedLimit(unit_name, most / unit),
         [&](double v) { return v > 0 && v * unit <= most; });
    if (number > 0) value = number * unit;
  }

  /// What the user can do about a value that is refused from now on.
  void SetAdvice(Message advice) { advice_ = std::move(advice); }

  /// One of the names of an enumeration.
  template <typename Enum>
  void TakeName(std::string_view key, Enum& value) {
    std::vector<std::string> known;
    for (const std::string_view name : kNamesOf<Enum>) known.push_back(fmt::format("\"{}\"", name));
    std::string found;
    Take(key, found, say::config::ExpectedOneOf(std::move(known)),
         [](const std::string& text) { return Named<Enum>(text).has_value(); });
    if (!found.empty()) value = Named<Enum>(found).value();
  }

  /// A list of texts that are not empty.
  void TakeNames(
      std::string_view key, std::vector<std::string>& names, const Message& expected,
      std::size_t most,
      const std::function<bool(const std::string&)>& is_valid = [](const auto&) { return true; }) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const toml::array* array = node->as_array();
    if (array == nullptr || array->size() > most) Fail(*node, key, expected);
    names.clear();
    for (const toml::node& element : *array) {
      const std::optional<std::string> name = element.value_exact<std::string>();
      if (!name || name->empty() || name->size() > 255 || !IsPlainText(*name) || !is_valid(*name))
        Fail(element, key, expected);
      names.push_back(*name);
    }
  }

  /// Rows of finite numbers; nothing if the key is absent. A single row may be written without the
  /// outer brackets.
  std::optional<std::vector<std::vector<double>>> TakeRows(std::string_view key,
                                                           std::size_t num_rows,
                                                           std::size_t num_columns,
                                                           const Message& expected) {
    const toml::node* node = Find(key);
    if (node == nullptr) return std::nullopt;
    std::vector<std::vector<double>> rows;
    const auto read_row = [&](const toml::node& row_node) {
      const toml::array* row = row_node.as_array();
      if (row == nullptr || row->size() != num_columns) Fail(row_node, key, expected);
      rows.emplace_back();
      for (const toml::node& element : *row) {
        const std::optional<double> number =
            element.is_number() ? element.value<double>() : std::nullopt;
        if (!number || !std::isfinite(*number)) Fail(element, key, expected);
        rows.back().push_back(*number);
      }
    };
    if (num_rows == 1) {
      read_row(*node);
    } else {
      const toml::array* array = node->as_array();
      if (array == nullptr || array->size() != num_rows) Fail(*node, key, expected);
      for (const toml::node& row : *array) read_row(row);
    }
    return rows;
  }

  /// A key that this program does not take from the file.
  /// @param where  States where the value belongs.
  void Refuse(std::string_view key, const Message& where) const {
    if (table_ == nullptr) return;
    const toml::node* node = table_->get(key);
    if (node == nullptr) return;
    throw DataError(say::config::NotTaken(file_, node->source().begin.line, KeyHere(key), where));
  }

  void RejectUnknownKeys() const {
    if (table_ == nullptr) return;
    for (const auto& [key, node] : *table_) {
      if (std::find(taken_.begin(), taken_.end(), key.str()) != taken_.end()) continue;
      throw DataError(say::config::UnknownKey(file_, node.source().begin.line, key.str(), name_,
                                              NearestName(key.str(), taken_), taken_));
    }
  }

  [[noreturn]] void Fail(const toml::node& node, std::string_view key,
                         const Message& expected) const {
    std::ostringstream found;
    node.visit([&found](const auto& n) { found << n; });
    const std::int64_t line = node.source().begin.line;
    throw DataError(advice_.empty()
                        ? say::config::WrongValue(file_, line, KeyHere(key), expected, found.str())
                        : say::config::WrongValueWithAdvice(file_, line, KeyHere(key), expected,
                                                            found.str(), advice_));
  }

 private:
  [[nodiscard]] std::string KeyHere(std::string_view key) const {
    return fmt::format("{}.{}", name_, key);
  }

  const toml::node* Find(std::string_view key) {
    taken_.emplace_back(key);
    return table_ == nullptr ? nullptr : table_->get(key);
  }

  std::string name_;
  const std::string& file_;
  const toml::table* table_ = nullptr;
  std::vector<std::string> taken_;
  Message advice_;
};

}  // namespace plumb
