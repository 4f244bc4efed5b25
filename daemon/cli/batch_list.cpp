// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/batch_list.hpp"

#include <optional>
#include <string>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

/// A million paths of usual length.
constexpr std::size_t kMaxListBytes = std::size_t{256} << 20;
constexpr std::size_t kMaxItems = 1'000'000;
constexpr std::string_view kBlanks = " \t\r";

std::string_view WithoutBlanks(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::vector<std::string_view> SplitAtTabs(std::string_view line) {
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t tab = line.find('\t');
    parts.push_back(WithoutBlanks(line.substr(0, tab)));
    if (tab == std::string_view::npos) return parts;
    line.remove_prefix(tab + 1);
  }
}

/// Nothing if a quote is not closed, or text follows it without a blank.
std::optional<std::vector<std::string_view>> SplitAtBlanks(std::string_view line) {
  std::vector<std::string_view> parts;
  while (!(line = WithoutBlanks(line)).empty()) {
    const bool is_quoted = line.front() == '"' || line.front() == '\'';
    const std::size_t end = is_quoted ? line.find(line.front(), 1) : line.find(' ');
    if (is_quoted && end == std::string_view::npos) return std::nullopt;
    parts.push_back(is_quoted ? line.substr(1, end - 1) : line.substr(0, end));
    line.remove_prefix(end == std::string_view::npos ? line.size() : end + (is_quoted ? 1 : 0));
    if (!line.empty() && line.front() != ' ') return std::nullopt;
  }
  return parts;
}

std::optional<BatchInputs> InputsOf(std::string_view line, std::size_t paths_an_item) {
  if (line.find('\0') != std::string_view::npos) return std::nullopt;
  if (paths_an_item == 1) return BatchInputs{line};
  const auto parts =
      line.find('\t') != std::string_view::npos ? SplitAtTabs(line) : SplitAtBlanks(line);
  if (!parts || parts->size() != paths_an_item) return std::nullopt;
  BatchInputs inputs;
  for (const std::string_view part : *parts) {
    if (part.empty()) return std::nullopt;
    inputs.emplace_back(part);
  }
  return inputs;
}

}  // namespace

std::vector<BatchInputs> ParseBatchList(std::string_view text, std::string_view name,
                                        std::size_t paths_an_item) {
  std::vector<BatchInputs> items;
  for (std::int64_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view line = WithoutBlanks(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    if (items.size() == kMaxItems)
      throw DataError(say::cli::ListTooLong(name, static_cast<std::int64_t>(kMaxItems)));
    std::optional<BatchInputs> inputs = InputsOf(line, paths_an_item);
    if (!inputs)
      throw DataError(say::cli::ListLine(name, number, static_cast<std::int64_t>(paths_an_item)));
    items.push_back(std::move(*inputs));
  }
  if (items.empty()) throw DataError(say::cli::ListEmpty(name));
  return items;
}

std::vector<BatchInputs> ReadBatchList(const std::filesystem::path& file,
                                       std::size_t paths_an_item) {
  return ParseBatchList(ReadTextFile(file, kMaxListBytes), file.string(), paths_an_item);
}

}  // namespace plumb
