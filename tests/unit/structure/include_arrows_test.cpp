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
    {"algo/types", {"algo/base"}},
    {"algo/geometry", {"algo/base", "algo/types"}},
    {"algo/markers", {"algo/base", "algo/types", "algo/geometry"}},
    {"algo/sensor_model", {"algo/base"}},
    {"algo/tracking",
     {"algo/base", "algo/types", "algo/geometry", "algo/markers", "algo/sensor_model"}},
    {"algo/reconstruction",
     {"algo/base", "algo/types", "algo/geometry", "algo/markers", "algo/sensor_model",
      "algo/tracking"}},
    {"algo/acceptance", {"algo/base"}},
    {"algo/comparison",
     {"algo/base", "algo/types", "algo/geometry", "algo/sensor_model", "algo/acceptance"}},
    {"algo/render", {"algo/base", "algo/types"}},

    // A program on top of everything, though it lies beside the method that it opens to Python.
    {"algo/python",
     {"algo/base", "algo/types", "algo/comparison", "daemon/config", "daemon/evaluation",
      "daemon/files", "daemon/pipeline", "drivers/replay"}},

    {"drivers", {"algo/base", "algo/types"}},
    {"drivers/files", {"algo/base"}},
    {"drivers/replay", {"algo/base", "algo/types", "drivers/files"}},
    {"drivers/simulated", {"algo/base", "algo/types", "drivers/files", "drivers/replay"}},
    {"drivers/live", {"algo/base", "algo/types", "drivers", "drivers/files", "drivers/replay"}},
    {"drivers/openni",
     {"algo/base", "algo/types", "drivers", "drivers/files", "drivers/live", "drivers/replay",
      "drivers/usb"}},
    {"drivers/virtual",
     {"algo/base", "algo/types", "drivers/files", "drivers/live", "drivers/replay",
      "drivers/simulated"}},
    {"drivers/virtual/openni",
     {"algo/base", "algo/types", "drivers", "drivers/files", "drivers/live", "drivers/openni",
      "drivers/replay", "drivers/virtual"}},
    {"drivers/virtual/plugin", {"drivers/virtual"}},
    {"drivers/usb", {"algo/base"}},
    {"drivers/gpio", {"algo/base", "drivers"}},

    {"web/model", {"algo/base", "algo/acceptance"}},
    {"web/service", {"algo/base", "web/model"}},
    {"web/security", {"algo/base", "web/model"}},
    {"web/http", {"algo/base", "web/service", "web/security"}},
    {"web/assets", {}},
    {"web/api",
     {"algo/base", "web/assets", "web/http", "web/model", "web/security", "web/service"}},

    {"daemon/loop", {}},
    {"daemon/config",
     {"algo/base", "algo/types", "algo/comparison", "algo/reconstruction", "drivers/live"}},
    {"daemon/pipeline",
     {"algo/base", "algo/types", "algo/acceptance", "algo/reconstruction", "daemon/loop",
      "drivers/replay"}},
    {"daemon/files",
     {"algo/base", "algo/types", "algo/sensor_model", "algo/comparison", "algo/render",
      "drivers/files"}},
    {"daemon/records",
     {"algo/base", "algo/types", "algo/sensor_model", "algo/acceptance", "algo/comparison",
      "daemon/files", "drivers/files", "web/model"}},
    {"daemon/update", {"algo/base", "daemon/loop", "drivers/files", "web/model"}},
    {"daemon/control", {"algo/base", "daemon/loop"}},
    {"daemon/evaluation",
     {"algo/base", "algo/types", "algo/geometry", "algo/acceptance", "algo/comparison",
      "daemon/files", "drivers/files"}},
    {"daemon/appliance",
     {"algo/base",           "algo/types",   "algo/sensor_model", "algo/comparison",
      "algo/reconstruction", "algo/render",  "daemon/config",     "daemon/control",
      "daemon/files",        "daemon/loop",  "daemon/pipeline",   "daemon/records",
      "daemon/update",       "drivers",      "drivers/files",     "drivers/gpio",
      "drivers/live",        "web/api",      "web/assets",        "web/http",
      "web/model",           "web/security", "web/service"}},
    {"daemon/cli",
     {"algo/base", "algo/types", "algo/sensor_model", "algo/acceptance", "algo/comparison",
      "daemon/config", "daemon/control", "daemon/evaluation", "daemon/files", "daemon/loop",
      "daemon/pipeline", "daemon/records", "drivers/files", "drivers/gpio", "drivers/live",
      "drivers/replay", "drivers/simulated"}},
    {"daemon", {"algo/base", "daemon/appliance", "daemon/cli", "daemon/config", "daemon/loop"}},
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
    if (from == to) continue;
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

TEST(IncludeArrowsTest, TheMethodKnowsNoProgramAndTheWebOnlyValues) {
  for (const auto& [folder, allowed] : kAllowed) {
    for (const std::string& to : allowed) {
      EXPECT_NE(to, "algo/python") << folder << " includes a program";
      if (folder.starts_with("algo") && folder != "algo/python") {
        EXPECT_TRUE(to.starts_with("algo/")) << folder << " -> " << to;
      }
      if (folder.starts_with("drivers")) {
        EXPECT_TRUE(to.starts_with("drivers") || to == "algo/types" || to == "algo/base")
            << folder << " -> " << to;
      }
      if (folder.starts_with("web")) {
        EXPECT_TRUE(to.starts_with("web/") || to == "algo/base" ||
                    (folder == "web/model" && to == "algo/acceptance"))
            << folder << " -> " << to;
      }
      if (folder == "daemon/records" || folder == "daemon/update") {
        EXPECT_TRUE(!to.starts_with("web/") || to == "web/model") << folder << " -> " << to;
      }
    }
  }
}

}  // namespace
}  // namespace plumb
