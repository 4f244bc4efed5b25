// SPDX-License-Identifier: Apache-2.0
// Text that shows what it holds: a name that turns the line around, or two that look the same but
// differ by what is invisible, must not get into a record.
#pragma once

#include <string>
#include <string_view>

namespace plumb {

/// Well-formed UTF-8 without control characters (except tab and line feed, if allowed), without
/// Unicode's format characters (category Cf: directions, joiners, blanks of no width, tags) and its
/// separators of lines and paragraphs.
[[nodiscard]] bool IsPlainText(std::string_view text, bool allow_lines = false);

/// The same text, with U+FFFD for everything that is not plain text: for what devices and other
/// programs' files are called, which is not refused for it.
[[nodiscard]] std::string AsPlainText(std::string_view text);

}  // namespace plumb
