// SPDX-License-Identifier: Apache-2.0
// OpenNI2's interface for drivers, with two macros that it takes from a library that is not
// packaged.
#pragma once

#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(pointer) delete (pointer)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#include <Driver/OniDriverAPI.h>
#pragma GCC diagnostic pop

#include <cstring>

namespace plumb::simulated {

/// Answers a property query. OpenNI2 passes the size of the buffer.
template <typename Value>
OniStatus Answer(const Value& value, void* data, int* size) {
  if (*size != static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(data, &value, sizeof value);
  return ONI_STATUS_OK;
}

/// Sets a property.
template <typename Value>
OniStatus Accept(const void* data, int size, Value& value) {
  if (size != static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(&value, data, sizeof value);
  return ONI_STATUS_OK;
}

}  // namespace plumb::simulated
