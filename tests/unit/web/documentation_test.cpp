// web/openapi.yaml against the server's own table.
#include <gmock/gmock.h>

#include <fstream>
#include <set>

#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

/// "GET /path permission" of every operation. The file is parsed by its indentation
/// alone: paths by two, methods by four, the rest deeper.
std::set<std::string> DocumentedOperations() {
  std::ifstream in(PLUMB_SOURCE_DIR "/web/openapi.yaml");
  std::set<std::string> operations;
  std::string line, path, method;
  bool in_paths = false;
  while (std::getline(in, line)) {
    if (!line.empty() && line[0] != ' ' && line[0] != '#') in_paths = line == "paths:";
    if (!in_paths) continue;
    if (line.starts_with("  /")) path = line.substr(2, line.find(':') - 2);
    if (line.starts_with("    ") && line.size() > 4 && line[4] != ' ') {
      method = line.substr(4, line.find(':') - 4);
      std::transform(method.begin(), method.end(), method.begin(),
                     [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    }
    const std::string key = "      x-permission: ";
    if (line.starts_with(key))
      operations.insert(method + " " + path + " " + line.substr(key.size()));
  }
  return operations;
}

class DocumentationTest : public WebTest {};

TEST_F(DocumentationTest, OpenApiListsExactlyWhatTheServerAnswers) {
  Start();
  const std::vector<std::string> names = server_->RouteNames();
  EXPECT_EQ(DocumentedOperations(), std::set<std::string>(names.begin(), names.end()));
}

}  // namespace
}  // namespace plumb::test
