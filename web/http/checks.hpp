// SPDX-License-Identifier: Apache-2.0
// Checks of input from browsers and other clients, before it is used. Pure functions; each has a
// fuzz target.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace plumb::web {

/// True for "localhost", a numeric address, or one of `names`, each with or without a port. Rejects
/// a foreign page whose name resolves to this machine (DNS rebinding).
[[nodiscard]] bool IsKnownHost(std::string_view host, std::span<const std::string> names);

/// An Origin header ("http://host:port") of this server, given the request's own Host header.
[[nodiscard]] bool IsSameOrigin(std::string_view origin, std::string_view host, bool tls);

/// The value of a cookie; nothing if it is absent or occurs twice (which suggests a planted
/// cookie).
[[nodiscard]] std::optional<std::string> CookieValue(std::string_view header,
                                                     std::string_view name);

/// application/x-www-form-urlencoded; nothing if malformed, above 16 fields, or if a field occurs
/// twice.
[[nodiscard]] std::optional<std::map<std::string, std::string>> ParseForm(std::string_view body);

/// True if a coding named gzip or * is accepted with a weight above 0; an absent header accepts any
/// coding.
[[nodiscard]] bool AcceptsGzip(std::optional<std::string_view> accept_encoding);

/// A value of a path parameter: [A-Za-z0-9._-]{1,64} without a leading dot, so that it cannot lead
/// out of a folder.
[[nodiscard]] bool IsName(std::string_view text);

/// The address that counters use: one machine can have all addresses of an IPv6 network of 64 bits
/// ("2001:db8:1:2::"), so they count as one; other addresses are returned unchanged.
[[nodiscard]] std::string NetworkOf(const std::string& address);

/// A name of a header field (RFC 9110): letters, digits and some marks, without a blank; not empty.
[[nodiscard]] bool IsToken(std::string_view text);

/// A Transfer-Encoding of "chunked" alone, the only coding that is taken.
[[nodiscard]] bool IsChunked(std::string_view transfer_encoding);

/// Escapes text for an HTML element or a quoted attribute.
[[nodiscard]] std::string EscapeHtml(std::string_view text);

}  // namespace plumb::web
