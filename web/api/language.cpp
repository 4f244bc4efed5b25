#include "web/api/language.hpp"

#include "algo/base/errors.hpp"

namespace plumb::web {

Language LanguageIn(const Request& request) {
  const auto found = request.query.find("language");
  if (found == request.query.end() || found->second == "en") return Language::kEnglish;
  if (found->second == "es") return Language::kSpanish;
  throw DataError("language: expected en or es");
}

}  // namespace plumb::web
