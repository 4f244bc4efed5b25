// SPDX-License-Identifier: Apache-2.0
// How the store refuses.
#pragma once

#include "daemon/records/store.hpp"

namespace plumb {

/// How the store has answered `call`: kDone unless it refused.
template <typename Call>
[[nodiscard]] ChangeResult RefusalOf(const Call& call) {
  try {
    call();
  } catch (const StoreRefusal& refusal) {
    return refusal.result();
  }
  return ChangeResult::kDone;
}

}  // namespace plumb
