#include "web/http/event_hub.hpp"

#include <fmt/format.h>

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
  std::list<std::shared_ptr<EventStream>> own, of_account;
  for (const auto& stream : streams_) {
    if (stream->closed()) continue;
    if (&stream->session() == session.get()) own.push_back(stream);
    if (stream->session().user == session->user) of_account.push_back(stream);
  }
  if (own.size() >= limits_.of_session) {
    own.front()->Close();
  } else if (of_account.size() >= limits_.of_account) {
    of_account.front()->Close();
  }
  if (streams_.size() >= limits_.all) return nullptr;
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
