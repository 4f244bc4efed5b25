// SPDX-License-Identifier: Apache-2.0
#include "web/http/checks.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/utf8.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxHost = 255;
constexpr std::size_t kMaxFormFields = 16;

std::string_view Trim(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

bool IsNumericAddress(const std::string& host) {
  std::array<unsigned char, 16> address{};
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    return inet_pton(AF_INET6, host.substr(1, host.size() - 2).c_str(), address.data()) == 1;
  }
  return inet_pton(AF_INET, host.c_str(), address.data()) == 1;
}

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::optional<std::string> UnescapeForm(std::string_view text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '+') {
      plain += ' ';
    } else if (text[i] == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const int high = HexDigit(text[i + 1]), low = HexDigit(text[i + 2]);
      if (high < 0 || low < 0) return std::nullopt;
      plain += static_cast<char>(high * 16 + low);
      i += 2;
    } else {
      plain += text[i];
    }
  }
  return plain;
}

}  // namespace

bool IsKnownHost(std::string_view host, std::span<const std::string> names) {
  if (host.empty() || host.size() > kMaxHost) return false;
  const auto bracket = host.rfind(']');
  const auto colon = host.find(':', bracket == std::string_view::npos ? 0 : bracket);
  std::string name = AsciiLower(host.substr(0, colon));
  if (colon != std::string_view::npos) {
    const std::string_view port = host.substr(colon + 1);
    const bool digits =
        std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (port.empty() || port.size() > 5 || !digits) return false;
  }
  if (name == "localhost" || IsNumericAddress(name)) return true;
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& known) { return AsciiLower(known) == name; });
}

bool IsSameOrigin(std::string_view origin, std::string_view host, bool tls) {
  const std::string_view scheme = tls ? "https://" : "http://";
  if (!origin.starts_with(scheme)) return false;
  return AsciiLower(origin.substr(scheme.size())) == AsciiLower(host);
}

std::optional<std::string> CookieValue(std::string_view header, std::string_view name) {
  std::optional<std::string> value;
  while (!header.empty()) {
    const auto end = header.find(';');
    const std::string_view pair = Trim(header.substr(0, end));
    header = end == std::string_view::npos ? std::string_view() : header.substr(end + 1);
    const auto equals = pair.find('=');
    if (equals == std::string_view::npos || pair.substr(0, equals) != name) continue;
    if (value) return std::nullopt;
    value = std::string(pair.substr(equals + 1));
  }
  return value;
}

std::optional<std::map<std::string, std::string>> ParseForm(std::string_view body) {
  std::map<std::string, std::string> fields;
  while (!body.empty()) {
    const auto end = body.find('&');
    const std::string_view pair = body.substr(0, end);
    body = end == std::string_view::npos ? std::string_view() : body.substr(end + 1);
    const auto equals = pair.find('=');
    if (equals == std::string_view::npos) return std::nullopt;
    const auto name = UnescapeForm(pair.substr(0, equals)),
               value = UnescapeForm(pair.substr(equals + 1));
    if (!name || !value || fields.size() >= kMaxFormFields || !fields.emplace(*name, *value).second)
      return std::nullopt;
  }
  return fields;
}

bool AcceptsGzip(std::optional<std::string_view> accept_encoding) {
  if (!accept_encoding) return true;
  std::string_view rest = *accept_encoding;
  bool any = false;
  while (!rest.empty()) {
    const auto end = rest.find(',');
    const std::string item = AsciiLower(Trim(rest.substr(0, end)));
    rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
    const auto semicolon = item.find(';');
    const std::string coding(Trim(std::string_view(item).substr(0, semicolon)));
    const std::string_view weight =
        semicolon == std::string::npos ? "" : Trim(std::string_view(item).substr(semicolon + 1));
    const bool refused =
        weight.starts_with("q=0") && weight.find_first_of("123456789", 3) == std::string_view::npos;
    if (coding == "gzip") return !refused;
    if (coding == "*" && !refused) any = true;
  }
  return any;
}

bool IsName(std::string_view text) {
  constexpr std::size_t kMaxName = 64;
  if (text.empty() || text.size() > kMaxName || text.front() == '.') return false;
  return std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-';
  });
}

std::string NetworkOf(const std::string& address) {
  in6_addr v6{};
  if (inet_pton(AF_INET6, address.c_str(), &v6) != 1 || IN6_IS_ADDR_V4MAPPED(&v6) ||
      IN6_IS_ADDR_LOOPBACK(&v6))
    return address;
  std::fill(std::begin(v6.s6_addr) + 8, std::end(v6.s6_addr), std::uint8_t{0});
  std::array<char, INET6_ADDRSTRLEN> text{};
  inet_ntop(AF_INET6, &v6, text.data(), text.size());
  return text.data();
}

bool IsToken(std::string_view text) {
  static constexpr std::string_view kMarks = "!#$%&'*+-.^_`|~";
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return c < 0x80 &&
           (std::isalnum(c) != 0 || kMarks.find(static_cast<char>(c)) != std::string_view::npos);
  });
}

bool IsChunked(std::string_view transfer_encoding) {
  return AsciiLower(Trim(transfer_encoding)) == "chunked";
}

std::string EscapeHtml(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

}  // namespace plumb::web
