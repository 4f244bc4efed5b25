// SPDX-License-Identifier: Apache-2.0
// Two pairs of keys, made by age-keygen for these tests.
#pragma once

namespace plumb::testing {

inline constexpr const char* kIdentity =
    "# created: 2026-11-28T07:29:38Z\n"
    "# public key: age1z8q8p3f3getd6h87azd0zc2vzskwttwywjqumzv8yqddd73pwg3svc56n6\n"
    "AGE-SECRET-KEY-134545DWEL3WXXRSG9QS9WCHFSJ4WCLS5SFZC6TF8G7DD7WCUF7MQ9YNFUH\n";
inline constexpr const char* kRecipient =
    "age1z8q8p3f3getd6h87azd0zc2vzskwttwywjqumzv8yqddd73pwg3svc56n6";
inline constexpr const char* kOtherIdentity =
    "AGE-SECRET-KEY-192E4RRUMGZ38L6DX8JW9DEJFCHEDHTGGX9UFF90304KZA6LDSA9SFWSV2Z\n";
inline constexpr const char* kOtherRecipient =
    "age1tpc5h407m2y9cxp6y3ss25e5lx940veqnvpalekkg400ynzhau8sep55u4";

}  // namespace plumb::testing
