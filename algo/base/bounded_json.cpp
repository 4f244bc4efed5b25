#include "algo/base/bounded_json.hpp"

#include <fmt/format.h>

#include "algo/base/errors.hpp"

namespace plumb {

template <class Json>
Json ParseBoundedJson(std::string_view text) {
  using Event = typename Json::parse_event_t;
  const auto refuse_depth = [](int depth, Event event, Json&) {
    const bool opens = event == Event::array_start || event == Event::object_start;
    if (opens && depth >= kMaxJsonDepth)
      throw DataError(
          fmt::format("expected JSON nested at most {} deep, found more", kMaxJsonDepth));
    return true;
  };
  try {
    return Json::parse(text, refuse_depth);
  } catch (const nlohmann::detail::exception& error) {
    throw DataError(fmt::format("not valid JSON ({})", error.what()));
  }
}

template <class Json>
Json ParseBoundedJsonOrNothing(std::string_view text) {
  try {
    return ParseBoundedJson<Json>(text);
  } catch (const DataError&) {
    return Json(Json::value_t::discarded);
  }
}

template nlohmann::json ParseBoundedJson(std::string_view);
template nlohmann::json ParseBoundedJsonOrNothing(std::string_view);
template nlohmann::ordered_json ParseBoundedJson(std::string_view);
template nlohmann::ordered_json ParseBoundedJsonOrNothing(std::string_view);

}  // namespace plumb
