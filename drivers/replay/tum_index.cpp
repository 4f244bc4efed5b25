// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_index.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "algo/base/statistics.hpp"
#include "words/recording.hpp"

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

double ParseStamp(std::string_view token, const Message& where) {
  const std::optional<double> time_s = ParseNumber<double>(token);
  if (!time_s || !std::isfinite(*time_s) || *time_s < 0) {
    throw DataError(say::recording::NotAStamp(where, Quoted(token)));
  }
  if (*time_s > kMaxTime_s) {
    throw DataError(say::recording::StampTooLarge(where, Quoted(token)));
  }
  return *time_s;
}

/// A name as programs of other systems write it: in quotes, with backslashes.
std::string PlainName(std::string_view text) {
  if (text.size() >= 2 && (text.front() == '"' || text.front() == '\'') &&
      text.back() == text.front())
    text = text.substr(1, text.size() - 2);
  std::string name(text);
  std::ranges::replace(name, '\\', '/');
  return name;
}

void CheckFileName(std::string_view file, const Message& where) {
  if (file.find('\0') != std::string_view::npos)
    throw DataError(say::recording::FileNameZero(where));
  const std::filesystem::path path(file);
  const bool climbs = std::any_of(path.begin(), path.end(),
                                  [](const std::filesystem::path& part) { return part == ".."; });
  const bool has_drive = file.size() > 2 && file[1] == ':' && file[2] == '/';  // As C:/rgb/a.png.
  if (path.is_absolute() || climbs || has_drive) {
    throw DataError(say::recording::FileNameLeaves(where, Quoted(file)));
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
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"))
    throw DataError(say::recording::ListUtf16(name));
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);  // What Windows' editors put first.
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++line_number;
    const Message where = say::recording::Line(name, line_number);
    if (line.size() > kMaxLine)
      throw DataError(say::recording::LineTooLong(where, line.size(), kMaxLine));
    line = Trimmed(line);
    if (line.empty() || line.front() == '#') continue;

    const auto blank = std::find_if(line.begin(), line.end(), IsBlank);
    const auto length = static_cast<std::size_t>(blank - line.begin());
    const double time_s = ParseStamp(line.substr(0, length), where);
    const std::string file = PlainName(Trimmed(line.substr(length)));
    if (file.empty()) throw DataError(say::recording::FileNameMissing(where));
    CheckFileName(file, where);
    if (!entries.empty() && !(time_s > entries.back().time_s)) {
      const double before_s = entries.back().time_s;
      throw DataError(time_s == before_s ? say::recording::StampRepeats(where, time_s, before_s)
                                         : say::recording::StampEarlier(where, time_s, before_s));
    }
    if (entries.size() == kMaxEntries)
      throw DataError(say::recording::TooManyImages(name, kMaxEntries));
    entries.push_back({time_s, file});
  }
  return entries;
}

double MedianPeriod(std::span<const IndexEntry> entries) {
  std::vector<double> periods_s;
  for (std::size_t i = 1; i < entries.size(); ++i)
    periods_s.push_back(entries[i].time_s - entries[i - 1].time_s);
  if (periods_s.empty()) return 0.0;
  return TakeMedian(periods_s);
}

double LargestGap(std::span<const IndexEntry> color, std::span<const IndexEntry> depth,
                  double least_s) {
  // The nearest partner is at most half a period away; a tenth of that is added for jitter.
  constexpr double kMaxGapPeriods = 0.55;
  return std::max(least_s, kMaxGapPeriods * std::max(MedianPeriod(color), MedianPeriod(depth)));
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
