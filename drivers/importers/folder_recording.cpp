// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/folder_recording.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "drivers/importers/recorded_file.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// The last number in a name, by which colour and depth images are paired.
std::optional<std::int64_t> NumberOf(std::string_view name) {
  const std::size_t end = name.find_last_of("0123456789");
  if (end == std::string_view::npos) return std::nullopt;
  const std::size_t before = name.find_last_not_of("0123456789", end);
  const std::size_t begin = before == std::string_view::npos ? 0 : before + 1;
  return ParseNumber<std::int64_t>(name.substr(begin, end + 1 - begin));
}

class ListedFolder : public ImportedRecording {
 public:
  ListedFolder(ImageFolder contents, ImportedFacts facts, const RecordingDefaults& defaults)
      : facts_(std::move(facts)) {
    facts_.color_images = std::ssize(contents.color);
    for (const IndexEntry& entry : contents.depth) facts_.depth_s.push_back(entry.time_s);
    frames_ = OpenImageFolder(std::move(contents), defaults);
    facts_.camera = frames_->camera();
  }
  [[nodiscard]] const StreamInfo& info() const override { return frames_->info(); }
  [[nodiscard]] const ImportedFacts& facts() const override { return facts_; }
  [[nodiscard]] std::optional<Frame> Next() override { return frames_->Next(); }

 private:
  ImportedFacts facts_;
  std::unique_ptr<TumSource> frames_;
};

}  // namespace

bool EndsLike(std::string_view name, std::string_view ending) {
  return AsciiLower(name).ends_with(ending);
}

bool IsImageName(const std::string& name, std::string_view ending, bool is_depth) {
  if (!ending.empty()) return EndsLike(name, ending);
  return EndsLike(name, ".png") ||
         (!is_depth && (EndsLike(name, ".jpg") || EndsLike(name, ".jpeg")));
}

Numbered NumberedImages(const fs::path& folder, const std::string& sub, std::string_view ending,
                        bool is_depth) {
  Numbered images;
  std::error_code error;
  for (fs::directory_iterator entry(folder / sub, error), end; entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!IsImageName(name, ending, is_depth)) continue;
    const std::string stem = ending.empty() ? entry->path().stem().string()
                                            : name.substr(0, name.size() - ending.size());
    const std::optional<std::int64_t> number = NumberOf(stem);
    if (!number) throw DataError(say::foreign::NameWithoutNumber((folder / sub / name).string()));
    if (images.size() >= kMostRecordedImages)
      throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
    if (!images.emplace(*number, sub.empty() ? name : sub + "/" + name).second)
      throw DataError(say::foreign::NumberTwice((folder / sub).string(), *number));
  }
  if (error) throw DataError(say::foreign::Unreadable());
  return images;
}

std::unique_ptr<ImportedRecording> OpenListedFolder(ImageFolder contents, ImportedFacts facts,
                                                    const RecordingDefaults& defaults) {
  return std::make_unique<ListedFolder>(std::move(contents), std::move(facts), defaults);
}

}  // namespace plumb
