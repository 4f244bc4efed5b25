// The folder in which bundles wait to be installed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "web/service/change.hpp"

namespace plumb {

[[nodiscard]] web::Change Refused(web::ChangeResult result, std::string message);

/// Files named NAME.raucb. One thread.
class BundleFolder {
 public:
  using Aside = std::function<bool(std::function<void()>)>;

  /// @param aside  See UpdaterOptions.
  BundleFolder(std::filesystem::path folder, std::uint64_t max_bytes, Aside aside)
      : folder_(std::move(folder)), max_bytes_(max_bytes), aside_(std::move(aside)) {}

  /// Names, sorted; at most 32.
  [[nodiscard]] std::vector<std::string> List() const;
  [[nodiscard]] bool Has(const std::string& name) const;
  /// Takes a file among the bundles, by moving it: kInvalid where it can be none, kConflict where
  /// there are too many.
  [[nodiscard]] web::Change Add(const std::filesystem::path& file, const std::string& name) const;
  [[nodiscard]] web::Change Remove(const std::string& name) const;
  /// What was being sent when the power went.
  void RemoveUnfinished() const;

 private:
  std::filesystem::path folder_;
  std::uint64_t max_bytes_;
  Aside aside_;
};

}  // namespace plumb
