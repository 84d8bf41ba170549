#pragma once
/// The three steps of a control request: the client's thread reads it, a short step runs on the
/// hub's thread, and the client's thread writes the answer. The duration of the step on the hub's
/// thread does not depend on the size of the request.

#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

#include "abbe/base/refusal.hpp"
#include "abbe/service/hub.hpp"

namespace abbe::daemon {

/// Writes the answer. May be called on any thread.
using Reply = std::function<nlohmann::json()>;
/// The step that runs on the hub's thread.
using OnHub = std::function<Reply(const Hub&)>;

inline Reply reply(nlohmann::json answer) {
  return [answer = std::move(answer)] { return answer; };
}
inline Reply reply(const Error& error) {
  return [error] { return refusal(error); };
}
inline Reply reply_done(const Result<void>& done) {
  return done ? reply(nlohmann::json{{"ok", true}}) : reply(done.error());
}

}  // namespace abbe::daemon
