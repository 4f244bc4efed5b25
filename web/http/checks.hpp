// Checks of what browsers and others send, before anything acts on it. Pure functions; each has a
// fuzz target.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace plumb::web {

/// Well-formed UTF-8 without control characters (but for tab and line feed, where allowed).
[[nodiscard]] bool IsPlainText(std::string_view text, bool allow_lines = false);

/// True for "localhost", an address in numbers, or one of `names`, each with or without a port. A
/// page from elsewhere that lets its own name point at this machine (DNS rebinding) fails here.
[[nodiscard]] bool IsKnownHost(std::string_view host, std::span<const std::string> names);

/// An Origin header ("http://host:port") that is this server's, given the request's own Host
/// header.
[[nodiscard]] bool IsSameOrigin(std::string_view origin, std::string_view host, bool tls);

/// The value of a cookie; nothing where it is absent or named twice (two of them: somebody plants
/// one).
[[nodiscard]] std::optional<std::string> CookieValue(std::string_view header,
                                                     std::string_view name);

/// application/x-www-form-urlencoded; nothing where malformed, above 16 fields, or a field is twice
/// there.
[[nodiscard]] std::optional<std::map<std::string, std::string>> ParseForm(std::string_view body);

/// True if a coding named gzip or * is accepted with a weight above 0; an absent header accepts
/// what comes.
[[nodiscard]] bool AcceptsGzip(std::optional<std::string_view> accept_encoding);

/// Placeholders' values: [A-Za-z0-9._-]{1,64}, no dot first: no way out of a folder.
[[nodiscard]] bool IsName(std::string_view text);

/// Text for an HTML element or a quoted attribute.
[[nodiscard]] std::string EscapeHtml(std::string_view text);

}  // namespace plumb::web
