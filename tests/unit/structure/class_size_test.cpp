// SPDX-License-Identifier: Apache-2.0
// How many functions the product's classes offer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tests/unit/structure/source_text.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// A class is a hub when everybody asks it for everything.
constexpr int kMostFunctions = 25;  // measured: 20, of the appliance
constexpr int kMostOfAppliance = 20;

// Whether a member's declaration up to its body or semicolon declares a function of the class,
// other than what makes, copies, moves, destroys and compares it.
bool IsFunction(std::string_view declaration, const std::string& name_of_class) {
  int angles = 0;
  std::size_t open = std::string_view::npos;
  for (std::size_t i = 0; i < declaration.size(); ++i) {
    if (declaration[i] == '<') ++angles;
    if (declaration[i] == '>' && i > 0 && declaration[i - 1] != '-') --angles;
    if (angles > 0) continue;
    if (declaration[i] == '=') return false;  // a member with its value
    if (declaration[i] != '(') continue;
    open = i;
    break;
  }
  if (open == std::string_view::npos) return false;
  std::string_view before = declaration.substr(0, open);
  for (const char* other : {"friend ", "using ", "operator", "static_assert", "typedef "})
    if (before.find(other) != std::string_view::npos) return false;
  const std::string name = LastWord(before);
  return !name.empty() && name != name_of_class && name[0] != '~';
}

struct Class {
  std::string name;
  int num_functions = 0;
};

// The classes of a source, each with the public functions that it declares itself.
std::vector<Class> ClassesOf(std::string_view source) {
  const std::string code = CodeOnly(source);
  struct Scope {
    bool is_class = false, is_public = true;
    std::size_t index = 0;
  };
  std::vector<Class> classes;
  std::vector<Scope> scopes;
  std::string text;  // since the last statement's end
  const auto count = [&] {
    if (!scopes.empty() && scopes.back().is_class && scopes.back().is_public &&
        IsFunction(text, classes[scopes.back().index].name))
      ++classes[scopes.back().index].num_functions;
  };
  int round = 0;  // open parentheses; what is in them belongs to the statement
  for (std::size_t i = 0; i < code.size(); ++i) {
    const char c = code[i];
    round += (c == '(' ? 1 : 0) - (c == ')' ? 1 : 0);
    if (round > 0) {
      text += c;
      continue;
    }
    if (c == ';') {
      count();
      text.clear();
    } else if (c == '{') {
      Scope scope;
      std::string_view head = text;
      if (const std::size_t base = head.find(" : "); base != std::string_view::npos)
        head = head.substr(0, base);
      const bool is_struct = head.find("struct ") != std::string_view::npos;
      if ((is_struct || head.find("class ") != std::string_view::npos) &&
          head.find("enum ") == std::string_view::npos &&
          head.find('(') == std::string_view::npos) {
        std::string name = LastWord(head);
        if (name == "final") name = LastWord(head);
        scope = {.is_class = true, .is_public = is_struct, .index = classes.size()};
        classes.push_back({name, 0});
      } else {
        count();
      }
      scopes.push_back(scope);
      text.clear();
    } else if (c == '}') {
      if (!scopes.empty()) scopes.pop_back();
      text.clear();
    } else if (c == ':' && !scopes.empty() && scopes.back().is_class) {
      std::string_view words = text;
      std::string_view rest = words;
      const std::string label = LastWord(rest);
      const bool is_label = rest.find_first_not_of(" \n") == std::string_view::npos;
      if (is_label && (label == "public" || label == "private" || label == "protected")) {
        scopes.back().is_public = label == "public";
        text.clear();
      } else {
        text += c;
      }
    } else {
      text += c;
    }
  }
  return classes;
}

TEST(ClassSizeTest, NoClassOfTheProductOffersMoreThanSomebodyCanRemember) {
  const fs::path root = PLUMB_SOURCE_DIR;
  std::map<std::string, int> found;
  for (const char* top : {"algo", "drivers", "web", "daemon"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".cpp" && extension != ".hpp") continue;
      std::ifstream file(entry.path());
      const std::string source{std::istreambuf_iterator<char>(file), {}};
      for (const Class& one : ClassesOf(source))
        found[one.name + " in " + fs::relative(entry.path(), root).string()] = one.num_functions;
    }
  }
  ASSERT_GT(found.size(), 500U) << "far fewer means that nothing was read";
  for (const auto& [name, num_functions] : found)
    EXPECT_LE(num_functions, kMostFunctions) << name << " has become a hub";
  const auto appliance = found.find("Appliance in daemon/appliance/appliance.hpp");
  ASSERT_NE(appliance, found.end());
  EXPECT_LE(appliance->second, kMostOfAppliance)
      << "commands in, events out: who needs a part of it gets that from SharedParts";
  EXPECT_GE(appliance->second, kMostOfAppliance / 2) << "they are no longer seen";
}

TEST(ClassSizeTest, ThePublicFunctionsOfAClassAreCounted) {
  const std::vector<Class> classes = ClassesOf(R"source(
#define TWICE(a) a(); \
    a();
namespace a {
enum class Colour { kRed };
class Shown final : public Base<int(int)> {
 public:
  explicit Shown(int a = f()) : a_(a), b_{a} { Begin(); }
  ~Shown() override;
  Shown(const Shown&) = delete;
  bool operator==(const Shown&) const = default;
  /// One; two(); not three().
  [[nodiscard]] std::string One(const std::function<void(int)>& told = {}) const { return ")};"; }
  void Two(); void Two(int other);
  template <typename T>
  std::enable_if_t<(sizeof(T) > 1), T> Three(T value) { struct Inner { void A(); }; return value; }
  std::function<void(int)> no_function = [](int) {};
  struct Part { int Four(); int five = Six(1'000); };
  using Alias = int (*)(int);
 protected:
  void Hidden();
 private:
  void Hidden(int);
};
struct Open : Shown { virtual void A() = 0; int b = 0; private: void C(); public: auto D() -> int; };
void Free(struct Open& open) { open.A(); }
}
)source");
  std::map<std::string, int> counted;
  for (const Class& one : classes) counted[one.name] = one.num_functions;
  EXPECT_EQ(counted,
            (std::map<std::string, int>{{"Shown", 4}, {"Inner", 1}, {"Part", 1}, {"Open", 2}}));
}

}  // namespace
}  // namespace plumb
