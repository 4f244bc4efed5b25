// SPDX-License-Identifier: Apache-2.0
// The folders' dependencies, written by hand and compared with every #include of the product.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Arrows = std::map<std::string, std::set<std::string>>;

// Each folder and the folders that it may include from. An arrow that is missing here is refused;
// one that would close a circle is refused even if somebody adds it.
const Arrows kAllowed = {
    {"algo/base", {}},
    {"algo/sensor_model", {"algo/base"}},
    {"algo/types", {"algo/base", "algo/sensor_model"}},
    {"algo/geometry", {"algo/base", "algo/types", "algo/sensor_model"}},
    {"algo/markers", {"algo/base", "algo/types", "algo/geometry"}},
    {"algo/sensor_calibration", {"algo/base", "algo/sensor_model"}},
    {"algo/map", {"algo/base", "algo/types", "algo/sensor_model"}},
    {"algo/bundle",
     {"algo/base", "algo/types", "algo/sensor_calibration", "algo/map", "algo/sensor_model"}},
    {"algo/diagnosis",
     {"algo/base", "algo/types", "algo/geometry", "algo/markers", "algo/sensor_calibration",
      "algo/map"}},
    {"algo/tracking",
     {"algo/base", "algo/types", "algo/geometry", "algo/markers", "algo/map", "algo/bundle",
      "algo/sensor_model"}},
    {"algo/surface", {"algo/base", "algo/types", "algo/geometry", "algo/sensor_model"}},
    {"algo/registration",
     {"algo/base", "algo/types", "algo/geometry", "algo/sensor_calibration", "algo/map",
      "algo/bundle", "algo/surface", "algo/sensor_model"}},
    {"algo/published",
     {"algo/base", "algo/types", "algo/geometry", "algo/markers", "algo/surface"}},
    {"algo/reconstruction",
     {"algo/base", "algo/types", "algo/markers", "algo/sensor_calibration", "algo/map",
      "algo/diagnosis", "algo/tracking", "algo/surface", "algo/registration", "algo/motion",
      "algo/published", "algo/sensor_model"}},
    {"algo/verdict", {"algo/base"}},
    {"algo/motion", {"algo/base", "algo/types"}},
    {"algo/comparison",
     {"algo/base", "algo/types", "algo/geometry", "algo/sensor_calibration", "algo/verdict",
      "algo/motion", "algo/sensor_model"}},
    {"algo/planning", {"algo/base", "algo/types", "algo/surface"}},
    {"algo/monitoring",
     {"algo/base", "algo/types", "algo/markers", "algo/surface", "algo/verdict", "algo/motion",
      "algo/comparison", "algo/sensor_model"}},
    {"algo/render", {"algo/base", "algo/types", "algo/verdict"}},

    {"drivers", {"algo/base", "algo/types"}},
    {"drivers/files", {"algo/base"}},
    {"drivers/replay", {"algo/base", "algo/types", "drivers/files", "algo/sensor_model"}},
    {"drivers/stream", {"algo/base", "drivers", "drivers/files", "drivers/replay", "drivers/live"}},
    {"drivers/sdk",
     {"algo/base", "drivers/live", "drivers/replay", "drivers/usb", "algo/sensor_model"}},
    {"drivers/realsense", {"algo/base", "drivers/live", "drivers/sdk"}},
    {"drivers/freenect", {"algo/base", "drivers/live", "drivers/sdk"}},
    {"drivers/orbbec", {"algo/base", "drivers/live", "drivers/sdk"}},
    {"drivers/importers",
     {"algo/base", "algo/types", "drivers", "drivers/files", "drivers/replay", "drivers/stream",
      "algo/sensor_model"}},
    {"drivers/dicom", {"algo/base", "algo/types", "drivers", "drivers/files"}},
    {"drivers/simulator/world", {"algo/base", "algo/types"}},
    {"drivers/simulator/sensor",
     {"algo/base", "algo/types", "drivers/simulator/world", "algo/sensor_model"}},
    {"drivers/simulator/suites",
     {"algo/base", "algo/types", "drivers/files", "drivers/replay", "drivers/simulator/world",
      "drivers/simulator/sensor"}},
    {"drivers/live",
     {"algo/base", "algo/types", "drivers", "drivers/files", "drivers/replay",
      "algo/sensor_model"}},
    {"drivers/openni",
     {"algo/base", "algo/types", "drivers", "drivers/files", "drivers/replay", "drivers/live",
      "drivers/usb"}},
    {"drivers/simulator/player",
     {"algo/base", "algo/types", "drivers/files", "drivers/replay", "drivers/simulator/sensor",
      "drivers/simulator/suites", "drivers/live"}},
    {"drivers/simulator/openni",
     {"algo/base", "algo/types", "drivers", "drivers/files", "drivers/replay", "drivers/live",
      "drivers/openni", "drivers/simulator/player"}},
    {"drivers/usb", {"algo/base"}},
    {"drivers/gpio", {"algo/base", "drivers"}},

    {"web/model", {"algo/base", "algo/verdict"}},
    {"web/service", {"algo/base", "web/model"}},
    {"web/security", {"algo/base", "web/model"}},
    {"web/http", {"algo/base", "web/model", "web/service", "web/security"}},
    {"web/page", {}},
    {"web/exchange", {"algo/base", "web/model", "web/service", "web/http"}},
    {"web/api",
     {"algo/base", "web/model", "web/service", "web/security", "web/http", "web/exchange",
      "web/page"}},
    {"web/api/exports", {"algo/base", "web/model", "web/exchange", "web/api"}},
    {"web/api/planning", {"algo/base", "web/model", "web/http", "web/exchange", "web/api"}},
    {"web/api/watching",
     {"algo/base", "web/http", "web/model", "web/security", "web/exchange", "web/api"}},

    {"daemon/loop", {}},
    {"daemon/config",
     {"algo/base", "algo/types", "algo/reconstruction", "algo/comparison", "drivers/files",
      "drivers/live", "daemon/files"}},
    {"daemon/pipeline",
     {"algo/base", "algo/types", "algo/diagnosis", "algo/reconstruction", "algo/verdict",
      "drivers/replay", "daemon/loop"}},
    {"daemon/files",
     {"algo/base", "algo/types", "algo/sensor_calibration", "algo/verdict", "algo/motion",
      "algo/comparison", "algo/render", "drivers/files", "algo/sensor_model"}},
    {"daemon/result",
     {"algo/verdict", "algo/base", "algo/comparison", "algo/render", "algo/types", "daemon/files",
      "drivers/files"}},
    {"daemon/mesh_formats", {"algo/base", "algo/types", "daemon/files", "drivers/files"}},
    {"daemon/monitoring_files", {"algo/base", "algo/monitoring", "drivers/files", "daemon/files"}},
    {"daemon/planning",
     {"algo/base", "algo/planning", "drivers/dicom", "drivers/files", "daemon/files"}},
    {"daemon/received",
     {"algo/base", "algo/planning", "drivers/dicom", "drivers/files", "web/model",
      "daemon/planning", "daemon/unit"}},
    {"daemon/dicom",
     {"algo/base", "algo/planning", "drivers/dicom", "drivers/files", "daemon/files",
      "daemon/scan_files", "daemon/reports", "daemon/mesh_formats", "daemon/result"}},
    {"daemon/dicomd", {"algo/base", "drivers/files", "daemon/config"}},
    {"daemon/sheets", {"algo/base", "algo/types", "algo/comparison"}},
    {"daemon/scan_files", {"algo/base", "daemon/files", "drivers/files"}},
    {"daemon/database",
     {"algo/base", "algo/verdict", "drivers/files", "web/model", "daemon/scan_files",
      "daemon/result"}},
    {"daemon/state_folder", {"algo/base", "drivers/files", "daemon/scan_files", "daemon/database"}},
    {"daemon/records",
     {"algo/base", "algo/types", "algo/comparison", "drivers/files", "web/model",
      "daemon/scan_files", "daemon/database", "daemon/state_folder"}},
    {"daemon/sensor_profiles",
     {"algo/base", "algo/sensor_calibration", "daemon/files", "daemon/scan_files", "drivers/files",
      "web/model"}},
    {"daemon/imports", {"algo/base", "drivers/files", "daemon/database", "daemon/records"}},
    {"daemon/archive",
     {"algo/base", "drivers/files", "web/model", "daemon/files", "daemon/scan_files",
      "daemon/database", "daemon/imports", "daemon/state_folder", "daemon/records"}},
    {"daemon/network", {}},
    {"daemon/messages_out",
     {"algo/base", "drivers/files", "web/model", "daemon/loop", "daemon/config", "daemon/network"}},
    {"daemon/peers",
     {"algo/base", "web/security", "daemon/loop", "daemon/config", "daemon/network"}},
    {"daemon/directory",
     {"algo/base", "drivers/files", "web/security", "daemon/loop", "daemon/config"}},
    {"daemon/update",
     {"algo/base", "drivers/files", "web/model", "daemon/files", "daemon/scan_files", "daemon/loop",
      "daemon/network"}},
    {"daemon/control", {"algo/base", "daemon/loop", "daemon/files"}},
    {"daemon/evaluation",
     {"algo/base", "algo/types", "algo/geometry", "algo/verdict", "algo/motion", "algo/comparison",
      "algo/monitoring", "drivers/files", "drivers/simulator/suites", "daemon/files",
      "daemon/pipeline"}},
    {"daemon/reports",
     {"algo/base", "algo/types", "algo/verdict", "algo/motion", "algo/comparison", "algo/render",
      "drivers/files", "web/model", "web/service", "web/exchange", "daemon/loop", "daemon/config",
      "daemon/files", "daemon/records", "daemon/result", "daemon/sheets"}},
    {"daemon/unit",
     {"algo/base", "drivers/files", "web/model", "web/security", "web/http", "daemon/config",
      "daemon/files", "daemon/database", "daemon/records", "daemon/archive"}},
    {"daemon/storage",
     {"algo/base", "web/service", "daemon/loop", "daemon/config", "daemon/database",
      "daemon/state_folder", "daemon/records", "daemon/archive", "daemon/unit"}},
    {"daemon/sweep",
     {"algo/base", "algo/comparison", "algo/motion", "algo/reconstruction", "algo/types",
      "daemon/loop", "daemon/pipeline", "drivers", "drivers/live", "web/model"}},
    {"daemon/scanning",
     {"algo/base", "algo/comparison", "algo/reconstruction", "algo/sensor_calibration",
      "algo/types", "daemon/files", "daemon/imports", "daemon/loop", "daemon/pipeline",
      "daemon/records", "daemon/reports", "daemon/sensor_profiles", "daemon/sweep",
      "daemon/result"}},
    {"daemon/monitoring",
     {"algo/base", "algo/comparison", "algo/monitoring", "drivers/files", "daemon/files",
      "daemon/loop", "daemon/monitoring_files", "daemon/pipeline", "daemon/scanning",
      "daemon/sweep", "web/model"}},
    {"daemon/appliance",
     {"daemon/monitoring",
      "daemon/monitoring_files",
      "daemon/scanning",
      "algo/base",
      "algo/comparison",
      "daemon/config",
      "daemon/control",
      "daemon/database",
      "daemon/files",
      "daemon/loop",
      "daemon/messages_out",
      "daemon/peers",
      "daemon/sheets",
      "daemon/storage",
      "daemon/sweep",
      "daemon/unit",
      "drivers",
      "web/model",
      "web/service",
      "daemon/result"}},
    {"daemon/services",
     {"algo/base",
      "algo/comparison",
      "daemon/sensor_profiles",
      "daemon/dicom",
      "daemon/result",
      "drivers/dicom",
      "drivers/files",
      "web/model",
      "web/service",
      "daemon/loop",
      "daemon/config",
      "daemon/files",
      "daemon/archive",
      "daemon/update",
      "daemon/control",
      "daemon/reports",
      "daemon/planning",
      "daemon/received",
      "daemon/unit",
      "daemon/storage",
      "daemon/appliance",
      "daemon/monitoring_files",
      "daemon/monitoring"}},
    {"daemon/plumbd",
     {"algo/base", "algo/types", "algo/comparison", "drivers", "drivers/files", "drivers/live",
      "drivers/gpio", "web/model", "web/service", "web/security", "web/api", "daemon/loop",
      "daemon/config", "daemon/archive", "daemon/control", "daemon/directory", "daemon/unit",
      "daemon/appliance", "daemon/services"}},
    {"daemon/cli", {"algo/base",
                    "algo/types",
                    "algo/diagnosis",
                    "algo/sensor_calibration",
                    "algo/comparison",
                    "drivers/files",
                    "drivers/replay",
                    "drivers/simulator/suites",
                    "drivers/live",
                    "drivers/importers",
                    "drivers/dicom",
                    "algo/planning",
                    "daemon/planning",
                    "daemon/loop",
                    "daemon/config",
                    "daemon/pipeline",
                    "daemon/files",
                    "daemon/control",
                    "daemon/evaluation",
                    "daemon/reports",
                    "daemon/sheets",
                    "daemon/scan_files",
                    "daemon/monitoring_files",
                    "daemon/dicom",
                    "daemon/mesh_formats",
                    "daemon/result"}},
    {"daemon/cli/unit",
     {"algo/base", "drivers/dicom", "drivers/files", "drivers/gpio", "drivers/live",
      "daemon/archive", "daemon/cli", "daemon/config", "daemon/control", "daemon/database",
      "daemon/files", "daemon/pipeline", "daemon/scan_files", "drivers/simulator/suites",
      "algo/verdict", "daemon/result"}},
    // A program on top of everything.
    {"daemon/python",
     {"algo/base", "algo/types", "algo/comparison", "drivers/replay", "daemon/config",
      "daemon/pipeline", "daemon/files", "daemon/evaluation", "daemon/result"}},
    {"daemon",
     {"algo/base", "drivers/dicom", "daemon/loop", "daemon/config", "daemon/plumbd", "daemon/cli",
      "daemon/dicomd"}},
};

struct Include {
  std::string file, included;
};

std::string FolderOf(const std::string& path) { return fs::path(path).parent_path().string(); }

// Every quoted include of the product's sources.
std::vector<Include> IncludesOf(const fs::path& root) {
  std::vector<Include> found;
  const std::regex quoted("^\\s*#\\s*include\\s*\"([^\"]+)\"");
  for (const char* top : {"algo", "drivers", "web", "daemon"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".cpp" && extension != ".hpp") continue;
      std::ifstream source(entry.path());
      std::smatch match;
      for (std::string line; std::getline(source, line);)
        if (std::regex_search(line, match, quoted))
          found.push_back({fs::relative(entry.path(), root).string(), match[1].str()});
    }
  }
  return found;
}

// A path of arrows from a folder back to itself; empty where there is none.
std::string Circle(const Arrows& arrows) {
  std::map<std::string, int> state;  // 1: on the way, 2: done
  std::vector<std::string> way;
  std::function<std::string(const std::string&)> visit = [&](const std::string& folder) {
    state[folder] = 1;
    way.push_back(folder);
    const auto known = arrows.find(folder);
    if (known != arrows.end()) {
      for (const std::string& next : known->second) {
        if (state[next] == 1) return way.back() + " -> " + next;
        if (state[next] == 2) continue;
        if (std::string circle = visit(next); !circle.empty()) return circle;
      }
    }
    state[folder] = 2;
    way.pop_back();
    return std::string();
  };
  for (const auto& [folder, allowed] : arrows)
    if (state[folder] == 0)
      if (std::string circle = visit(folder); !circle.empty()) return circle;
  return {};
}

TEST(IncludeArrowsTest, TheIncludesAreTheAllowedArrowsAndNoOthers) {
  const std::vector<Include> includes = IncludesOf(PLUMB_SOURCE_DIR);
  ASSERT_GT(includes.size(), 500U);  // measured: 1,030; far fewer means that nothing was read
  Arrows unused = kAllowed;
  for (const Include& include : includes) {
    const std::string from = FolderOf(include.file), to = FolderOf(include.included);
    // What the build makes of the catalogues, for everybody who has messages.
    if (from == to || to == "words") continue;
    const auto allowed = kAllowed.find(from);
    ASSERT_NE(allowed, kAllowed.end()) << from << " is not in the table; " << include.file;
    EXPECT_TRUE(allowed->second.contains(to)) << include.file << " includes " << include.included
                                              << ": " << from << " may not know " << to;
    unused[from].erase(to);
  }
  for (const auto& [from, arrows] : unused)
    EXPECT_THAT(arrows, testing::IsEmpty()) << "allowed to " << from << ", but used by no source";
}

TEST(IncludeArrowsTest, TheAllowedArrowsCloseNoCircle) { EXPECT_EQ(Circle(kAllowed), ""); }

TEST(IncludeArrowsTest, ACircleIsFound) {
  EXPECT_EQ(Circle({{"a", {"b"}}, {"b", {"c"}}, {"c", {"a"}}}), "c -> a");
}

// The sets of at least two nodes of which each reaches each other.
std::set<std::set<std::string>> Circles(const Arrows& arrows) {
  std::map<std::string, std::set<std::string>> reached;
  for (const auto& [from, next] : arrows) {
    std::vector<std::string> open(next.begin(), next.end());
    while (!open.empty()) {
      const std::string node = open.back();
      open.pop_back();
      if (!reached[from].insert(node).second) continue;
      if (const auto known = arrows.find(node); known != arrows.end())
        open.insert(open.end(), known->second.begin(), known->second.end());
    }
  }
  std::set<std::set<std::string>> circles;
  for (const auto& [from, all] : reached) {
    std::set<std::string> circle;
    for (const std::string& node : all)
      if (const auto back = reached.find(node);
          back != reached.end() && back->second.contains(from))
        circle.insert(node);
    if (!circle.empty()) circles.insert(circle);
  }
  return circles;
}

std::string WithoutExtension(const std::string& file) {
  return fs::path(file).replace_extension().string();
}

TEST(IncludeArrowsTest, FilesIncludeEachOtherInNoNewCircle) {
  Arrows of_headers, of_both;
  for (const Include& include : IncludesOf(PLUMB_SOURCE_DIR)) {
    if (include.file.ends_with(".hpp")) of_headers[include.file].insert(include.included);
    const std::string from = WithoutExtension(include.file);
    const std::string to = WithoutExtension(include.included);
    if (from != to) of_both[from].insert(to);
  }
  ASSERT_GT(of_both.size(), 300U) << "far fewer means that nothing was read";
  EXPECT_EQ(Circles(of_headers), std::set<std::set<std::string>>());
  EXPECT_EQ(Circles(of_both), std::set<std::set<std::string>>())
      << "a source and its header as one";
}

TEST(IncludeArrowsTest, EachCircleOfFilesIsFound) {
  EXPECT_EQ(Circles({{"a", {"b"}}, {"b", {"c"}}, {"c", {"b", "d"}}, {"e", {"f"}}, {"f", {"e"}}}),
            (std::set<std::set<std::string>>{{"b", "c"}, {"e", "f"}}));
}

TEST(IncludeArrowsTest, TheMethodKnowsNoProgramAndTheWebOnlyValues) {
  for (const auto& [folder, allowed] : kAllowed) {
    for (const std::string& to : allowed) {
      EXPECT_NE(to, "daemon/python") << folder << " includes a program";
      if (folder.starts_with("algo")) {
        EXPECT_TRUE(to.starts_with("algo/")) << folder << " -> " << to;
      }
      if (folder.starts_with("drivers")) {
        EXPECT_TRUE(to.starts_with("drivers") || to == "algo/types" || to == "algo/base" ||
                    to == "algo/sensor_model")
            << folder << " -> " << to;
      }
      if (folder.starts_with("web")) {
        EXPECT_TRUE(to.starts_with("web/") || to == "algo/base" ||
                    (folder == "web/model" && to == "algo/verdict"))
            << folder << " -> " << to;
      }
      if (folder == "daemon/database" || folder == "daemon/state_folder" ||
          folder == "daemon/records" || folder == "daemon/archive" || folder == "daemon/update") {
        EXPECT_TRUE(!to.starts_with("web/") || to == "web/model") << folder << " -> " << to;
      }
    }
  }
}

TEST(IncludeArrowsTest, TheTableForPeopleHasEachFolder) {
  std::ifstream file(fs::path(PLUMB_SOURCE_DIR) / "CONTRIBUTING.md");
  std::map<std::string, std::string> rows;  // of each top folder
  for (std::string line; std::getline(file, line);)
    for (const char* top : {"algo", "drivers", "web", "daemon"})
      if (line.starts_with("| `" + std::string(top) + "` | ")) rows[top] = line;
  for (const auto& [folder, included] : kAllowed) {
    const std::size_t slash = folder.find('/');
    // A folder that only one other has is found from there.
    if (slash == std::string::npos || folder.find('/', slash + 1) != std::string::npos) continue;
    EXPECT_THAT(rows[folder.substr(0, slash)],
                ::testing::HasSubstr("`" + folder.substr(slash + 1) + "`"))
        << folder;
  }
}

}  // namespace
}  // namespace plumb
