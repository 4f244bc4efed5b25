// SPDX-License-Identifier: Apache-2.0
#include "web/exchange/routes.hpp"

#include <charconv>
#include <memory>
#include <utility>

#include "algo/base/errors.hpp"
#include "web/exchange/json.hpp"
#include "web/http/gate.hpp"
#include "words/web.hpp"

namespace plumb::web {

Route& Routes::Read(const char* pattern, Permission permission, Get get) {
  return Add("GET", pattern, permission, BodyKind::kNone,
             [get = std::move(get)](const Request& request, const Respond& respond) {
               respond(get(request));
             });
}

Route& Routes::ReadInBackground(const char* pattern, Permission permission, Get get) {
  return Add("GET", pattern, permission, BodyKind::kNone,
             [&background = background_, name = std::string("GET ") + pattern,
              get = std::move(get)](const Request& request, const Respond& respond) {
               RespondInBackground(
                   background, name, [get, request] { return get(request); }, respond);
             });
}

Route& Routes::Write(const char* method, const char* pattern, Permission permission, BodyKind body,
                     Act act) {
  return Add(method, pattern, permission, body,
             [act = std::move(act)](const Request& request, const Respond& respond) {
               act(request, Answer(respond));
             });
}

Response ChangeResponse(const Change& change) {
  switch (change.result) {
    case ChangeResult::kDone:
      break;
    case ChangeResult::kInvalid:
      return ErrorResponse(400, change.message);
    case ChangeResult::kNotFound:
      return ErrorResponse(404, change.message);
    case ChangeResult::kConflict:
      return ErrorResponse(409, change.message);
    case ChangeResult::kRefused:
      return ErrorResponse(403, change.message);
    case ChangeResult::kNoSpace:
      return ErrorResponse(507, change.message);
    case ChangeResult::kFailed:
      return ErrorResponse(500, change.message);
  }
  Json json = Json::object();
  if (!change.id.empty()) json["id"] = change.id;
  if (!change.message.empty()) PutMessage(json, "message", change.message);
  return JsonResponse(json, change.id.empty() ? 200 : 201);
}

Done Answer(const Respond& respond) {
  return [respond](const Change& change) { respond(ChangeResponse(change)); };
}

const Catalogue& LanguageIn(const Request& request) {
  const auto found = request.query.find("language");
  if (found == request.query.end()) return EnglishCatalogue();
  if (const Catalogue* named = FindCatalogue(found->second)) return *named;
  throw DataError(say::web::FieldLanguage(LanguageCodes()));
}

Response FileResponse(const std::filesystem::path& file, std::string_view type,
                      const std::string& download_name) {
  Response response;
  try {
    response.file = std::make_shared<OpenFile>(file);
  } catch (const IoError&) {
    return ErrorResponse(404, say::web::ScanHasNoSuchFile());
  }
  response.type = std::string(type);
  NameDownload(response, download_name);
  return response;
}

std::int64_t QueryNumber(const Request& request, const std::string& name, std::int64_t otherwise,
                         std::int64_t max) {
  const auto found = request.query.find(name);
  if (found == request.query.end()) return otherwise;
  std::int64_t value = 0;
  const char* const end = found->second.data() + found->second.size();
  const auto [stop, error] = std::from_chars(found->second.data(), end, value);
  if (error != std::errc() || stop != end || value < 0 || value > max) {
    throw DataError(say::web::FieldWholeRange(name, max));
  }
  return value;
}

std::vector<std::string> LanguageCodes() {
  std::vector<std::string> codes;
  for (const Catalogue* one : Catalogues()) codes.emplace_back(one->code);
  return codes;
}

Done KeepingUpload(const Request& request, Done done) {
  auto upload = std::make_shared<std::shared_ptr<UploadFile>>(request.upload);
  return [done = std::move(done), upload = std::move(upload)](const Change& change) {
    upload->reset();
    done(change);
  };
}

}  // namespace plumb::web
