// A reset to the state of delivery.
#pragma once

namespace plumb::web {

/// What it keeps.
enum class FactoryReset { kKeepRecords, kWipe };

}  // namespace plumb::web
