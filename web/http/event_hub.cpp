// SPDX-License-Identifier: Apache-2.0
#include "web/http/event_hub.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <vector>

namespace plumb::web {

std::string_view EventStream::Peek(std::size_t max) const {
  return std::string_view(buffer_).substr(taken_, max);
}

void EventStream::Take(std::size_t count) {
  taken_ += count;
  if (taken_ == buffer_.size()) {
    buffer_.clear();
    taken_ = 0;
  }
}

void EventStream::Send(std::string_view text) {
  if (closed_) return;
  if (waiting() + text.size() > capacity_) {
    // A client that does not read gets no more memory; a browser reconnects by itself.
    buffer_ = std::string();
    taken_ = 0;
    closed_ = true;
    if (cut) cut();
    return;
  }
  buffer_.erase(0, taken_);
  taken_ = 0;
  buffer_ += text;
  if (wake) wake();
}

void EventStream::Close() {
  if (closed_) return;
  closed_ = true;
  if (wake) wake();
}

std::shared_ptr<EventStream> EventHub::Open(std::shared_ptr<Session> session) {
  std::vector<std::shared_ptr<EventStream>> own, open;  // the oldest first
  std::map<std::string, std::size_t> counts;
  for (const auto& stream : streams_) {
    if (stream->closed()) continue;
    open.push_back(stream);
    if (&stream->session() == session.get()) own.push_back(stream);
    ++counts[stream->session().user];
  }
  const auto end_oldest_of = [&](const auto& belongs) {
    const auto oldest = std::find_if(open.begin(), open.end(), belongs);
    if (oldest != open.end()) (*oldest)->Close();
  };
  const std::size_t of_account = counts[session->user];
  if (own.size() >= limits_.of_session) {
    own.front()->Close();
  } else if (of_account >= limits_.of_account) {
    end_oldest_of([&](const auto& stream) { return stream->session().user == session->user; });
  } else if (open.size() >= limits_.all) {
    const auto most =
        std::max_element(counts.begin(), counts.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    end_oldest_of(
        [&](const auto& stream) { return counts[stream->session().user] == most->second; });
  }
  streams_.push_back(std::make_shared<EventStream>(std::move(session), limits_.buffer_bytes));
  return streams_.back();
}

void EventHub::Broadcast(std::string_view event, std::string_view data) {
  const std::string text = FormatEvent(event, data);
  for (const auto& stream : std::list(streams_)) stream->Send(text);
}

void EventHub::Beat() {
  for (const auto& stream : std::list(streams_)) stream->Send(FormatEvent("beat", "{}"));
}

bool EventHub::EndOver() {
  bool any = false;
  for (const auto& stream : std::list(streams_)) {
    if (!stream->session().ended || stream->closed()) continue;
    stream->Send(FormatEvent("logged_off", "{}"));
    stream->Close();
    any = true;
  }
  return any;
}

void EventHub::CloseAll() {
  for (const auto& stream : std::list(streams_)) stream->Close();
}

std::string FormatEvent(std::string_view event, std::string_view data) {
  return fmt::format("event: {}\ndata: {}\n\n", event, data);
}

}  // namespace plumb::web
