// SPDX-License-Identifier: Apache-2.0
// Whom a process calls by DICOM, and as whom, as JSON from its parent.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json.hpp>

namespace plumb {

/// @tparam Request  With peer, own_ae_title and tls.
template <typename Request>
nlohmann::ordered_json CallToJson(const Request& request) {
  return {{"called", request.peer.ae_title},
          {"host", request.peer.host},
          {"port", request.peer.port},
          {"calling", request.own_ae_title},
          {"certificate", request.tls.certificate},
          {"key", request.tls.key},
          {"trusted", request.tls.trusted}};
}

/// @throws nlohmann::json::exception
template <typename Request>
Request CallFromJson(const nlohmann::ordered_json& json) {
  const auto word = [&](const char* key) { return json.at(key).template get<std::string>(); };
  Request request;
  request.peer = {.ae_title = word("called"),
                  .host = word("host"),
                  .port = json.at("port").template get<std::uint16_t>()};
  request.own_ae_title = word("calling");
  request.tls = {
      .certificate = word("certificate"), .key = word("key"), .trusted = word("trusted")};
  return request;
}

/// On one line, whatever bytes the texts have.
inline std::string LineOf(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace plumb
