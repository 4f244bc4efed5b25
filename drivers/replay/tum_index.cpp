#include "drivers/replay/tum_index.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <tuple>

#include "algo/types/errors.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxEntries = 1'000'000;
constexpr std::size_t kMaxLine = 4096;
constexpr double kMaxTime_s = 1e11;        // the year 5138; milliseconds and nanoseconds since 1970 lie above
constexpr std::ptrdiff_t kNeighbours = 4;  // candidates on either side of a stamp: bounds the work on absurdly dense stamps

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == ',' || c == '\r'; }

std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && IsBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
  return text;
}

/// Text from a file for a message: short and printable.
std::string Quoted(std::string_view text) {
  constexpr std::size_t kMax = 60;
  std::string quoted = "\"";
  for (const char c : text.substr(0, kMax)) quoted += (c >= ' ' && c < 0x7f) ? c : '?';
  return quoted + (text.size() > kMax ? "...\"" : "\"");
}

double ParseStamp(std::string_view token, const std::string& where) {
  double time_s = 0.0;
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), time_s);
  if (error != std::errc{} || end != token.data() + token.size() || !std::isfinite(time_s) || time_s < 0) {
    throw DataError(fmt::format("{}: {} is no time stamp, expected seconds", where, Quoted(token)));
  }
  if (time_s > kMaxTime_s) {
    throw DataError(
        fmt::format("{}: time stamp {} is too large for seconds; convert milli- or nanoseconds to seconds", where, Quoted(token)));
  }
  return time_s;
}

void CheckFileName(std::string_view file, const std::string& where) {
  if (file.find('\0') != std::string_view::npos) throw DataError(fmt::format("{}: the file name holds a zero byte", where));
  const std::filesystem::path path(file);
  const bool climbs = std::any_of(path.begin(), path.end(), [](const std::filesystem::path& part) { return part == ".."; });
  if (path.is_absolute() || climbs) {
    throw DataError(
        fmt::format("{}: file name {} leaves the recording's folder; list files inside it, relative to it", where, Quoted(file)));
  }
}

}  // namespace

std::vector<IndexEntry> ParseIndex(std::string_view text, const std::string& name) {
  std::vector<IndexEntry> entries;
  std::size_t line_number = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++line_number;
    const std::string where = fmt::format("{} line {}", name, line_number);
    if (line.size() > kMaxLine) throw DataError(fmt::format("{} has {} characters, at most {} are read", where, line.size(), kMaxLine));
    line = Trimmed(line);
    if (line.empty() || line.front() == '#') continue;

    const auto blank = std::find_if(line.begin(), line.end(), IsBlank);
    const auto length = static_cast<std::size_t>(blank - line.begin());
    const double time_s = ParseStamp(line.substr(0, length), where);
    const std::string_view file = Trimmed(line.substr(length));
    if (file.empty()) throw DataError(fmt::format("{}: the file name is missing, expected \"timestamp filename\"", where));
    CheckFileName(file, where);
    if (!entries.empty() && !(time_s > entries.back().time_s)) {
      throw DataError(
          fmt::format("{}: time stamp {:.6f} {} the one before ({:.6f}); the list must rise strictly: sort it and remove doubles", where,
                      time_s, time_s == entries.back().time_s ? "repeats" : "is earlier than", entries.back().time_s));
    }
    if (entries.size() == kMaxEntries) throw DataError(fmt::format("{} lists more than {} images", name, kMaxEntries));
    entries.push_back({time_s, std::string(file)});
  }
  return entries;
}

std::vector<IndexPair> AssociateByTime(std::span<const IndexEntry> color, std::span<const IndexEntry> depth, double max_gap_s) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;
  for (std::size_t c = 0; c < color.size(); ++c) {
    const auto after = std::partition_point(depth.begin(), depth.end(), [&](const IndexEntry& d) { return d.time_s < color[c].time_s; });
    const auto first = after - std::min(kNeighbours, after - depth.begin());
    const auto last = after + std::min(kNeighbours, depth.end() - after);
    for (auto d = first; d != last; ++d) {
      const double gap_s = std::abs(d->time_s - color[c].time_s);
      if (gap_s <= max_gap_s) candidates.emplace_back(gap_s, c, static_cast<std::size_t>(d - depth.begin()));
    }
  }
  std::sort(candidates.begin(), candidates.end());

  std::vector<bool> color_used(color.size());
  std::vector<bool> depth_used(depth.size());
  std::vector<IndexPair> pairs;
  for (const auto& [gap_s, c, d] : candidates) {
    if (color_used[c] || depth_used[d]) continue;
    color_used[c] = true;
    depth_used[d] = true;
    pairs.push_back({c, d});
  }
  std::sort(pairs.begin(), pairs.end(), [](const IndexPair& a, const IndexPair& b) { return a.color < b.color; });

  // Stamps denser than the gap can cross; time never runs backwards in what comes out.
  std::vector<IndexPair> rising;
  for (const IndexPair& pair : pairs) {
    if (rising.empty() || pair.depth > rising.back().depth) rising.push_back(pair);
  }
  return rising;
}

}  // namespace plumb
