// SPDX-License-Identifier: Apache-2.0
// How units of one clinic name a patient to each other without saying the code.
#pragma once

#include <string>
#include <string_view>

namespace plumb::web {

/// HMAC-SHA256 of PlainCode(), because codes that differ in nothing else are the same;
/// hexadecimal. Who knows the secret can try codes, so it is shared by units only.
[[nodiscard]] std::string PatientHash(std::string_view code, std::string_view secret);

}  // namespace plumb::web
