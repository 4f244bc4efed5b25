// Outputs that appear whole or not at all.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

namespace plumb {

/// The files of one kind of output folder: an existing folder of that kind may be replaced.
struct OutputKind {
  std::string_view name;         ///< For messages: "scene".
  std::string_view marker_file;  ///< Always there: "scene.json".
  std::vector<std::string_view>
      known_entries;  ///< Everything at its top level that is ours, the marker file included.
};

/// A folder that is written beside its target, under a hidden name, and takes the target's place
/// with Commit(). Destroyed without it (an error, a stop request) it leaves nothing behind. A
/// killed process leaves the hidden folder; the next output of the same name removes it. Not
/// thread-safe.
class AtomicFolder {
 public:
  /// Makes the hidden folder, and missing parents of the target.
  /// @throws IoError if the target is there and neither empty nor of this kind, or the system
  /// refuses.
  AtomicFolder(const std::filesystem::path& target, OutputKind kind);
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  /// Where to write.
  [[nodiscard]] const std::filesystem::path& path() const { return hidden_; }

  /// Forces everything to the disk and puts it in the target's place; an older output there goes
  /// away. Call once.
  /// @throws IoError; the target is then as it was.
  void Commit();

 private:
  void RemoveStale() const;
  void MakeHidden();
  void Discard();

  OutputKind kind_;
  std::filesystem::path target_;
  std::filesystem::path hidden_;
  std::vector<std::filesystem::path> made_parents_;  ///< Outermost first.
  int lock_ = -1;  ///< Open and locked while this object lives: others see that it is in use.
  bool committed_ = false;
};

/// The same for one file: `write` gets a hidden path beside the target. @throws IoError, and what
/// `write` throws.
void WriteFileAtomically(const std::filesystem::path& target,
                         const std::function<void(const std::filesystem::path&)>& write);

}  // namespace plumb
