// SPDX-License-Identifier: Apache-2.0
// What browsers send: bodies, headers, paths. The first byte chooses the reader; each either takes
// the text or refuses it.
#include <cstdlib>

#include "algo/base/plain_text.hpp"
#include "tests/fuzz/fuzz_one.hpp"
#include "web/exchange/json.hpp"
#include "web/http/checks.hpp"
#include "web/http/router.hpp"

namespace {

using namespace plumb::web;  // NOLINT: one file, one purpose

void CheckForm(std::string_view text) {
  if (const auto form = ParseForm(text); form && form->size() > 16) std::abort();
}

void CheckText(std::string_view text) {
  // What passes as plain text must pass through JSON without being replaced.
  if (plumb::IsPlainText(text, true) &&
      nlohmann::json::parse(nlohmann::json(std::string(text)).dump()) != std::string(text))
    std::abort();
  if (EscapeHtml(text).find('<') != std::string::npos) std::abort();
}

void CheckNames(std::string_view text) {
  if (IsName(text) && (text.find('/') != std::string_view::npos || text.starts_with('.')))
    std::abort();
  (void)CookieValue(text, "plumb_session");
  (void)AcceptsGzip(text);
  (void)IsSameOrigin(text, "localhost:80", false);
  const std::vector<std::string> names = {"plumb.example"};
  if (IsKnownHost(text, names) && text.find_first_of("/@?#\\") != std::string_view::npos)
    std::abort();
}

void CheckRoutes(std::string_view text) {
  static const Router router = [] {
    Router made;
    made.Add({"GET", "/api/v1/scans/{id}/files/{name}", Permission::kView, BodyKind::kNone, {}});
    made.Add({"PUT", "/api/v1/references/{id}/plan", Permission::kPlan, BodyKind::kJson, {}});
    return made;
  }();
  for (const std::string& argument : router.Find("GET", text).arguments) {
    if (!IsName(argument)) std::abort();
  }
}

void CheckFields(const std::string& body) {
  Fields fields(body);
  const std::string name = fields.Text("name", 1, 32);
  if (name.empty() || name.size() > 32 || !plumb::IsPlainText(name)) std::abort();
  (void)fields.Flag("disabled");
  fields.Finish();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view text = plumb::fuzz::Text(data + 1, size - 1);
  return plumb::fuzz::One([&] {
    switch (data[0] % 7) {
      case 0:
        return CheckForm(text);
      case 1:
        return CheckText(text);
      case 2:
        return CheckNames(text);
      case 3:
        return CheckRoutes(text);
      case 4:
        return CheckFields(std::string(text));
      case 5:
        return (void)ParsePlan(std::string(text));
      default:
        return (void)ParseSettingsChange(std::string(text));
    }
  });
}
