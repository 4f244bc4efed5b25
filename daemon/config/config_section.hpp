// One table of a configuration file: values are taken key by key, with line numbers in every error
// message.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/base/errors.hpp"
#include "algo/base/names.hpp"
#include "daemon/config/toml.hpp"

namespace plumb {

/// @param name  Name of the file for messages. @throws DataError naming file and line.
[[nodiscard]] toml::table ParseToml(const std::string& text, const std::string& name);

/// @param known  Names of the tables that the file may have. @throws DataError naming file and
/// line.
inline void RejectUnknownTables(const toml::table& root, const std::string& file,
                                std::initializer_list<std::string_view> known) {
  for (const auto& [key, node] : root) {
    if (std::find(known.begin(), known.end(), key.str()) != known.end()) continue;
    throw DataError(fmt::format("{}:{}: unknown table or key '{}'; expected [{}]", file,
                                node.source().begin.line, key.str(), fmt::join(known, "], [")));
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
    if (table_ == nullptr) Fail(*node, name_, "a table, [" + name_ + "]");
  }

  template <typename T, typename Check>
  void Take(std::string_view key, T& value, std::string_view expected, Check is_valid) {
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
    value = *found;
  }

  /// The same for an optional key, without which the value stays unchanged.
  template <typename T, typename Check>
  void Take(std::string_view key, std::optional<T>& value, std::string_view expected,
            Check is_valid) {
    T found{};
    if (Find(key) == nullptr) return;
    Take(key, found, expected, is_valid);
    value = found;
  }

  void TakeFlag(std::string_view key, bool& value) {
    Take(key, value, "true or false", [](bool) { return true; });
  }

  void TakePath(std::string_view key, std::filesystem::path& path) {
    std::string text;
    Take(key, text, "an absolute path of at most 4095 bytes",
         [](const std::string& s) { return s.starts_with('/') && s.size() < 4096; });
    if (!text.empty()) path = text;
  }

  /// A number in a range, with the name of its unit.
  void TakeNumber(std::string_view key, double& value, double least, double most,
                  std::string_view unit) {
    Take(key, value, fmt::format("{} from {} to {}", unit, least, most),
         [&](double v) { return v >= least && v <= most; });
  }

  /// A limit above 0 that may not exceed `most`.
  /// @param value  Like `most` in the unit inside the program, of which the file's is `unit`.
  void TakeLimit(std::string_view key, double& value, double most, double unit,
                 std::string_view unit_name) {
    double number = 0.0;
    Take(key, number, fmt::format("{} above 0 and at most {:g}", unit_name, most / unit),
         [&](double v) { return v > 0 && v * unit <= most; });
    if (number > 0) value = number * unit;
  }

  /// What the user can do about a value that is refused from now on.
  void SetAdvice(std::string advice) { advice_ = std::move(advice); }

  /// One of the names of an enumeration.
  template <typename Enum>
  void TakeName(std::string_view key, Enum& value) {
    std::vector<std::string> known;
    for (const std::string_view name : kNamesOf<Enum>) known.push_back(fmt::format("\"{}\"", name));
    std::string found;
    Take(key, found, fmt::format("one of {}", fmt::join(known, ", ")),
         [](const std::string& text) { return Named<Enum>(text).has_value(); });
    if (!found.empty()) value = Named<Enum>(found).value();
  }

  /// A list of texts that are not empty.
  void TakeNames(std::string_view key, std::vector<std::string>& names, std::string_view expected,
                 std::size_t most) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const toml::array* array = node->as_array();
    if (array == nullptr || array->size() > most) Fail(*node, key, expected);
    names.clear();
    for (const toml::node& element : *array) {
      const std::optional<std::string> name = element.value_exact<std::string>();
      if (!name || name->empty() || name->size() > 255) Fail(element, key, expected);
      names.push_back(*name);
    }
  }

  /// Rows of finite numbers; nothing if the key is absent. A single row may be written without the
  /// outer brackets.
  std::optional<std::vector<std::vector<double>>> TakeRows(std::string_view key,
                                                           std::size_t num_rows,
                                                           std::size_t num_columns,
                                                           std::string_view expected) {
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
  void Refuse(std::string_view key, std::string_view where) const {
    if (table_ == nullptr) return;
    const toml::node* node = table_->get(key);
    if (node == nullptr) return;
    throw DataError(fmt::format("{}:{}: {}.{} is not taken from this file: {}; remove the line",
                                file_, node->source().begin.line, name_, key, where));
  }

  void RejectUnknownKeys() const {
    if (table_ == nullptr) return;
    for (const auto& [key, node] : *table_) {
      if (std::find(taken_.begin(), taken_.end(), key.str()) != taken_.end()) continue;
      throw DataError(fmt::format("{}:{}: unknown key '{}' in [{}]; known are {}", file_,
                                  node.source().begin.line, key.str(), name_,
                                  fmt::join(taken_, ", ")));
    }
  }

  [[noreturn]] void Fail(const toml::node& node, std::string_view key,
                         std::string_view expected) const {
    std::ostringstream found;
    node.visit([&found](const auto& n) { found << n; });
    throw DataError(fmt::format("{}:{}: {}.{}: expected {}, found {}{}{}", file_,
                                node.source().begin.line, name_, key, expected, found.str(),
                                advice_.empty() ? "" : "; ", advice_));
  }

 private:
  const toml::node* Find(std::string_view key) {
    taken_.emplace_back(key);
    return table_ == nullptr ? nullptr : table_->get(key);
  }

  std::string name_;
  const std::string& file_;
  const toml::table* table_ = nullptr;
  std::vector<std::string> taken_;
  std::string advice_;
};

}  // namespace plumb
