// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/send_content.hpp"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "drivers/dicom/call_wire.hpp"
#include "words/dicom.hpp"

namespace plumb {

bool IsAeTitle(std::string_view text) {
  constexpr std::size_t kMostAeTitle = 16;
  return !text.empty() && text.size() <= kMostAeTitle && !text.starts_with(' ') &&
         !text.ends_with(' ') &&
         std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~' && c != '\\'; });
}

std::optional<DicomPeer> ParseDicomPeer(std::string_view text) {
  const std::size_t at = text.find('@');
  const std::size_t colon = text.rfind(':');
  if (at == std::string_view::npos || colon == std::string_view::npos || colon < at)
    return std::nullopt;
  std::string_view host = text.substr(at + 1, colon - at - 1);
  const bool is_v6 = host.starts_with('[') && host.ends_with(']');
  if (is_v6) host = host.substr(1, host.size() - 2);
  const auto is_of_host = [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '-' || (is_v6 && (c == ':' || c == '%'));
  };
  const auto port = ParseNumber<std::uint16_t>(text.substr(colon + 1));
  if (!IsAeTitle(text.substr(0, at)) || host.empty() || host.size() > 253 ||
      !std::ranges::all_of(host, is_of_host) || !port || *port == 0)
    return std::nullopt;
  return DicomPeer{
      .ae_title = std::string(text.substr(0, at)), .host = std::string(host), .port = *port};
}

std::string SendRequestText(const DicomSendRequest& request) {
  nlohmann::ordered_json json = CallToJson(request);
  json["files"] = request.files;
  return LineOf(json);
}

DicomSendRequest ParseSendRequest(std::string_view text) {
  try {
    const auto json = ParseBoundedJson<nlohmann::ordered_json>(text);
    auto request = CallFromJson<DicomSendRequest>(json);
    request.files = json.at("files").get<std::vector<std::string>>();
    return request;
  } catch (const nlohmann::json::exception&) {
    throw DataError(say::dicom::ReaderVersion());
  }
}

}  // namespace plumb
