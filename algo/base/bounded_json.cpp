// SPDX-License-Identifier: Apache-2.0
#include "algo/base/bounded_json.hpp"

#include "algo/base/errors.hpp"
#include "words/file.hpp"

namespace plumb {

template <class Json>
Json ParseBoundedJson(std::string_view text, int max_depth) {
  using Event = typename Json::parse_event_t;
  const auto refuse_depth = [max_depth](int depth, Event event, Json&) {
    const bool opens = event == Event::array_start || event == Event::object_start;
    if (opens && depth >= max_depth) throw DataError(say::file::JsonTooDeep(max_depth));
    return true;
  };
  try {
    return Json::parse(text, refuse_depth);
  } catch (const nlohmann::detail::exception& error) {
    throw DataError(say::file::NotJson(error.what()));
  }
}

template <class Json>
Json ParseBoundedJsonOrNothing(std::string_view text, int max_depth) {
  try {
    return ParseBoundedJson<Json>(text, max_depth);
  } catch (const DataError&) {
    return Json(Json::value_t::discarded);
  }
}

template nlohmann::json ParseBoundedJson(std::string_view, int);
template nlohmann::json ParseBoundedJsonOrNothing(std::string_view, int);
template nlohmann::ordered_json ParseBoundedJson(std::string_view, int);
template nlohmann::ordered_json ParseBoundedJsonOrNothing(std::string_view, int);

}  // namespace plumb
