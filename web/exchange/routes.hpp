// SPDX-License-Identifier: Apache-2.0
// Adds routes by the kind of their handlers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"
#include "web/http/router.hpp"
#include "web/model/change.hpp"
#include "web/service/background_work.hpp"
#include "web/service/scan_service.hpp"

namespace plumb::web {

/// Wraps a router while it is filled. Router and background work must outlive the handlers.
class Routes {
 public:
  Routes(Router& router, BackgroundWork& background) : router_(router), background_(background) {}

  using Get = std::function<Response(const Request&)>;
  using Act = std::function<void(const Request&, const Done&)>;

  /// A GET route that is answered on the loop.
  Route& Read(const char* pattern, Permission permission, Get get);
  /// For lists and files, which are not read on the loop.
  Route& ReadInBackground(const char* pattern, Permission permission, Get get);
  /// The outcome of `act` is the answer.
  Route& Write(const char* method, const char* pattern, Permission permission, BodyKind body,
               Act act);
  /// For handlers that answer in another way.
  Route& Add(const char* method, const char* pattern, Permission permission, BodyKind body,
             Handler handler) {
    return router_.Add({method, pattern, permission, body, std::move(handler)});
  }

 private:
  Router& router_;
  BackgroundWork& background_;
};

/// The answer to a change as HTTP: 200, 201 with an id, or the error.
[[nodiscard]] Response ChangeResponse(const Change& change);
/// Answers with the outcome of a change.
[[nodiscard]] Done Answer(const Respond& respond);

/// @param download_name  Name of the downloaded file; empty: the browser shows it.
[[nodiscard]] Response FileResponse(const std::filesystem::path& file, std::string_view type,
                                    const std::string& download_name);

/// Entries of a list at most.
inline constexpr int kMaxListed = 200;
/// A number of the query, from 0 to `max`; `otherwise` if it is not stated. @throws DataError
[[nodiscard]] std::int64_t QueryNumber(const Request& request, const std::string& name,
                                       std::int64_t otherwise, std::int64_t max);

/// Keeps the file that was sent until the answer, and not longer: who has the answer may send the
/// next one, although copies of this may be left on other threads.
[[nodiscard]] Done KeepingUpload(const Request& request, Done done);

/// Language named by "?language=es"; English if none is named.
/// @throws DataError for an unknown language
[[nodiscard]] const Catalogue& LanguageIn(const Request& request);
/// Codes of all languages, English first.
[[nodiscard]] std::vector<std::string> LanguageCodes();

}  // namespace plumb::web
