#include "drivers/replay/tum_index.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxEntries = 1'000'000;
constexpr std::size_t kMaxLine = 4096;
constexpr double kMaxTime_s =
    1e11;  // the year 5138; milliseconds and nanoseconds since 1970 are larger
constexpr std::ptrdiff_t kNeighbours =
    4;  // candidates on either side of a stamp; limits the work for extremely dense stamps

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
  const std::optional<double> time_s = ParseNumber<double>(token);
  if (!time_s || !std::isfinite(*time_s) || *time_s < 0) {
    throw DataError(
        fmt::format("{}: {} is not a time stamp, expected seconds", where, Quoted(token)));
  }
  if (*time_s > kMaxTime_s) {
    throw DataError(fmt::format(
        "{}: time stamp {} is too large for seconds; convert milli- or nanoseconds to seconds",
        where, Quoted(token)));
  }
  return *time_s;
}

void CheckFileName(std::string_view file, const std::string& where) {
  if (file.find('\0') != std::string_view::npos)
    throw DataError(fmt::format("{}: the file name contains a zero byte", where));
  const std::filesystem::path path(file);
  const bool climbs = std::any_of(path.begin(), path.end(),
                                  [](const std::filesystem::path& part) { return part == ".."; });
  if (path.is_absolute() || climbs) {
    throw DataError(fmt::format(
        "{}: file name {} leaves the recording's folder; list files inside it, relative to it",
        where, Quoted(file)));
  }
}

/// A possible pair, with the best chain of pairs that ends with it.
struct Candidate {
  IndexPair pair;
  double sum_s = 0.0;
  std::optional<std::size_t> previous;  ///< Index of the previous candidate in the chain.
};

/// The best chain among those that end before a depth image: a Fenwick tree of maxima.
class BestChain {
 public:
  struct End {
    double sum_s = 0.0;
    std::optional<std::size_t> candidate;
  };

  explicit BestChain(std::size_t size) : tree_(size + 1) {}

  [[nodiscard]] End Before(std::size_t depth) const {
    End best;
    for (std::size_t i = depth; i > 0; i &= i - 1) {
      if (tree_[i].sum_s > best.sum_s) best = tree_[i];
    }
    return best;
  }

  void Add(std::size_t depth, const End& end) {
    for (std::size_t i = depth + 1; i < tree_.size(); i += i & (~i + 1)) {
      if (end.sum_s > tree_[i].sum_s) tree_[i] = end;
    }
  }

 private:
  std::vector<End> tree_;
};

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
    if (line.size() > kMaxLine)
      throw DataError(
          fmt::format("{} has {} characters, at most {} are read", where, line.size(), kMaxLine));
    line = Trimmed(line);
    if (line.empty() || line.front() == '#') continue;

    const auto blank = std::find_if(line.begin(), line.end(), IsBlank);
    const auto length = static_cast<std::size_t>(blank - line.begin());
    const double time_s = ParseStamp(line.substr(0, length), where);
    const std::string_view file = Trimmed(line.substr(length));
    if (file.empty())
      throw DataError(
          fmt::format("{}: the file name is missing, expected \"timestamp filename\"", where));
    CheckFileName(file, where);
    if (!entries.empty() && !(time_s > entries.back().time_s)) {
      throw DataError(fmt::format(
          "{}: time stamp {:.6f} {} the one before ({:.6f}); the list must rise strictly: sort it "
          "and remove duplicates",
          where, time_s, time_s == entries.back().time_s ? "repeats" : "is earlier than",
          entries.back().time_s));
    }
    if (entries.size() == kMaxEntries)
      throw DataError(fmt::format("{} lists more than {} images", name, kMaxEntries));
    entries.push_back({time_s, std::string(file)});
  }
  return entries;
}

std::vector<IndexPair> AssociateByTime(std::span<const IndexEntry> color,
                                       std::span<const IndexEntry> depth, double max_gap_s) {
  std::vector<Candidate> candidates;
  BestChain best(depth.size());
  for (std::size_t c = 0; c < color.size(); ++c) {
    const auto after = std::partition_point(depth.begin(), depth.end(), [&](const IndexEntry& d) {
      return d.time_s < color[c].time_s;
    });
    const auto first = after - std::min(kNeighbours, after - depth.begin());
    const auto last = after + std::min(kNeighbours, depth.end() - after);
    const std::size_t first_of_color = candidates.size();
    for (auto d = first; d != last; ++d) {
      const double gap_s = std::abs(d->time_s - color[c].time_s);
      if (gap_s > max_gap_s) continue;
      const auto position = static_cast<std::size_t>(d - depth.begin());
      const BestChain::End before = best.Before(position);
      candidates.push_back({{c, position}, before.sum_s + 2 * max_gap_s - gap_s, before.candidate});
    }
    // Entered only now, so that no chain uses one colour image twice.
    for (std::size_t i = first_of_color; i < candidates.size(); ++i) {
      best.Add(candidates[i].pair.depth, {candidates[i].sum_s, i});
    }
  }
  std::vector<IndexPair> pairs;
  for (auto i = best.Before(depth.size()).candidate; i; i = candidates[*i].previous)
    pairs.push_back(candidates[*i].pair);
  std::reverse(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace plumb
