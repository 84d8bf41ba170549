#include <fmt/format.h>

#include <array>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/control_protocol.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/web/client_network.hpp"
#include "calibration_task.hpp"
#include "lock_within.hpp"
#include "page_context.hpp"
#include "responses.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kStorePatience{10}, kTurnPatience{3};
constexpr std::chrono::milliseconds kStorePeriod{100};
constexpr std::chrono::seconds kStopPatience{15};
constexpr std::chrono::milliseconds kStopPeriod{50};
constexpr daemon::JsonBounds kBodyBounds{.bytes = kMostRequestBytes, .depth = 8};

/// A request that changes something, the role that it needs, and the request to abbed that it
/// becomes.
struct Change {
  std::string_view path;
  WebRole role;
  Result<json> (*request)(const json& body);
};

Result<json> activation(const json& body) {
  return json{{"do", "activate"},
              {"id", body.at("id").get<std::string>()},
              {"why", body.value("why", std::string{})},
              {"force", body.value("force", false)}};
}

Result<json> rollback(const json& body) {
  return json{{"do", "rollback"},
              {"active", body.at("active").get<std::string>()},
              {"why", body.value("why", std::string{})}};
}

Result<json> cancellation(const json&) {
  return json{{"do", "cancel"}};
}

constexpr std::array kChanges{
    Change{"/api/activate", WebRole::Administer, activation},
    Change{"/api/rollback", WebRole::Administer, rollback},
    Change{"/api/calibrate", WebRole::Calibrate, calibration_task},
    Change{"/api/cancel", WebRole::Calibrate, cancellation},
};

/// A browser states where a request comes from; one of another site is refused.
bool from_this_site(const httplib::Request& request) {
  if (!request.has_header("Origin")) return true;
  const std::string origin = request.get_header_value("Origin");
  const auto host = origin.find("://");
  return host != std::string::npos && origin.substr(host + 3) == request.get_header_value("Host");
}

Result<json> body_of(const std::string& text) {
  if (text.empty()) return json::object();
  auto body = daemon::parse_json(text, "request", kBodyBounds);
  if (body && !body->is_object())
    return daemon::fail(ErrorCode::Usage, "the request must be a JSON object");
  return body;
}

std::string cookie(const PageContext& context, const std::string& token, long max_age_s) {
  return fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict; Max-Age={}{}", cookie_name(context),
                     token, max_age_s, context.options.settings.web.tls() ? "; Secure" : "");
}

void log_in(PageContext& context, const httplib::Request& request, const json& body,
            httplib::Response& response) {
  const auto user = body.at("user").get<std::string>();
  const auto session = context.sessions.log_in(user, body.at("password").get<std::string>(),
                                               client_network(request.remote_addr), Clock::now());
  if (!session) {
    const std::string line = fmt::format("{}: log in as \"{}\" refused: {}", peer_of(request),
                                         user.substr(0, 40), session.error().text);
    // Passwords that were checked are few, because an address must wait after five.
    if (session.error().text == Sessions::kWrong)
      context.report.always(line);
    else
      context.report.line("log in " + request.remote_addr, line);
    return send_error(response, session.error().code == ErrorCode::Refused ? 403 : 503,
                      session.error().text);
  }
  context.report.always(
      fmt::format("{}: {} logged in ({})", peer_of(request), session->user, name(session->role)));
  constexpr long kSeconds = 12L * 3600L;
  response.set_header("Set-Cookie", cookie(context, session->token, kSeconds));
  send_json(response, {{"user", session->user},
                       {"role", name(session->role)},
                       {"csrf", session->csrf},
                       {"may_view", true},
                       {"log_in", true}});
}

void log_out(PageContext& context, const httplib::Request& request, const WebSession& session,
             httplib::Response& response) {
  context.sessions.log_out(session.token);
  context.report.always(fmt::format("{}: {} logged out", peer_of(request), session.user));
  response.set_header("Set-Cookie", cookie(context, "", 0));
  send_json(response, json::object());
}

/// The answer of abbed. A change of the model store that another process delays is asked for again.
Result<json> ask_abbed(PageContext& context, const json& request) {
  const auto& socket = context.options.settings.config.control.socket;
  auto answer = daemon::ask_daemon(socket, request);
  const auto until = Clock::now() + kStorePatience;
  while (answer && answer->contains("change") && !answer->contains("id")) {
    if (context.stopping)
      return daemon::fail(ErrorCode::Io,
                          "abbe-web stops; the change may still take place: see History");
    if (Clock::now() > until)
      return daemon::fail(ErrorCode::Io,
                          "the model store has not answered for 10 s; the change may still take "
                          "place: see History");
    std::this_thread::sleep_for(kStorePeriod);
    answer = daemon::ask_daemon(socket, {{"do", "change"}, {"number", (*answer)["change"]}});
  }
  return answer;
}

/// Lets abbed make a change; the answer of abbed goes to the browser. nullopt: nothing was changed.
std::optional<json> change(PageContext& context, const WebSession& session, json request,
                           httplib::Response& response) {
  request["who"] = session.user;
  const auto what = request["do"].get<std::string>();
  std::unique_lock<std::mutex> turn;
  if (what != "cancel") {  // the end of a calibration waits for nothing
    turn = lock_within(context.changing, kTurnPatience, context.stopping);
    if (!turn) {
      send_error(response, 503,
                 "another change is not done yet: nothing was changed; try again in some seconds");
      return std::nullopt;
    }
  }
  auto answer = ask_abbed(context, request);
  context.report.always(
      fmt::format("{}: {}: {}", session.user, what, answer ? "done" : answer.error().text));
  send_result(response, answer);
  return answer ? std::optional{std::move(*answer)} : std::nullopt;
}

void change(PageContext& context, const WebSession& session, const Change& asked, const json& body,
            httplib::Response& response) {
  auto request = asked.request(body);
  if (!request) return send_error(response, request.error());
  (void)change(context, session, std::move(*request), response);
}

/// The outcome of a request to stop the measuring machine: {"number", "outcome", "text"}.
Result<json> stop_outcome(PageContext& context) {
  const auto& socket = context.options.settings.config.control.socket;
  const auto asked = daemon::ask_daemon(socket, {{"do", "machine"}, {"stop", true}});
  if (!asked) return asked;
  const auto number = asked->value("stop", std::uint64_t{1});
  for (const auto until = Clock::now() + kStopPatience; Clock::now() < until && !context.stopping;
       std::this_thread::sleep_for(kStopPeriod)) {
    const auto answer = daemon::ask_daemon(socket, {{"do", "machine"}});
    if (!answer) return answer;
    const json stop = answer->value("stop", json::object());
    if (stop.value("number", std::uint64_t{0}) >= number &&
        stop.value("outcome", "pending") != "pending")
      return stop;
  }
  return daemon::fail(ErrorCode::StopNotConfirmed,
                      "the machine has not confirmed its stop yet: it may be moving");
}

/// Any user may stop the machine. It waits for no other request.
void stop_machine(PageContext& context, const WebSession& session, httplib::Response& response) {
  auto stop = stop_outcome(context);
  if (stop && (*stop)["outcome"] != "stopped") {
    stop = daemon::fail(
        (*stop)["outcome"] == "not sent" ? ErrorCode::StopNotSent : ErrorCode::StopNotConfirmed,
        fmt::format("the stop of the machine is {}: {}; use its emergency stop",
                    (*stop)["outcome"].get<std::string>(), (*stop)["text"].get<std::string>()));
  }
  context.report.always(fmt::format("{}: stop of the machine: {}", session.user,
                                    stop ? (*stop)["text"].get<std::string>() : stop.error().text));
  send_result(response, stop);
}

void replay(PageContext& context, const WebSession& session, const json& body,
            httplib::Response& response) {
  const auto recording = body.at("name").get<std::string>();
  const std::lock_guard lock(context.beginning);
  if (context.identifications.running())
    return send_error(response, {ErrorCode::Refused, "an identification is running: wait for it"});
  if (const auto begun = context.replays.begin(recording); !begun)
    return send_error(response, begun.error());
  context.report.always(fmt::format("{}: replay of {}", session.user, recording));
  send_json(response, context.replays.status());
}

void identify(PageContext& context, const WebSession& session, const json& body,
              httplib::Response& response) {
  const std::lock_guard lock(context.beginning);
  if (context.replays.running())
    return send_error(response, {ErrorCode::Refused, "a replay is running: wait for it"});
  if (const auto begun = context.identifications.begin(body, session.user); !begun)
    return send_error(response, begun.error());
  const json status = context.identifications.status();
  context.report.always(
      fmt::format("{}: identification of {} again", session.user, status.value("name", "")));
  send_json(response, status);
}

void cancel_identification(PageContext& context, const WebSession& session, const json&,
                           httplib::Response& response) {
  if (const auto cancelled = context.identifications.cancel(session.user); !cancelled)
    return send_error(response, cancelled.error());
  context.report.always(fmt::format("{}: identification cancelled", session.user));
  send_json(response, context.identifications.status());
}

/// Adds the model that was identified again to the store, as `abbe model add` does: abbed, to whom
/// the store belongs, checks it.
void add_identified(PageContext& context, const WebSession& session, const json& body,
                    httplib::Response& response) {
  const auto id = body.at("id").get<std::string>();
  const auto model = context.identifications.model(id);
  if (!model) return send_error(response, model.error());
  json request{{"do", "add"}, {"model", model->text}, {"why", model->from}};
  constexpr std::size_t kOtherMembers = 4096;
  constexpr std::size_t kMost = daemon::kRequestBounds.bytes - kOtherMembers;
  if (daemon::json_text(request["model"]).size() > kMost)
    return send_error(
        response,
        {ErrorCode::Refused,
         fmt::format("the model has more than {} bytes: save it as model.json, then `sudo -u abbe "
                     "abbe model add model.json -c {}`",
                     kMost, context.options.config_file.string())});
  if (change(context, session, std::move(request), response))
    context.identifications.note_added(id);
}

void refuse_role(PageContext& context, const httplib::Request& request, const WebSession& session,
                 WebRole needed, httplib::Response& response) {
  context.report.line("role " + session.user,
                      fmt::format("{}: {} refused to {}: needs the role {}", peer_of(request),
                                  request.path, session.user, name(needed)));
  send_error(response, 403,
             fmt::format("{} has the role {}; this needs the role {}", session.user,
                         name(session.role), name(needed)));
}

/// What a user with the role calibrate may do with recorded runs.
struct RecordedRun {
  std::string_view path;
  void (*answer)(PageContext&, const WebSession&, const json& body, httplib::Response&);
};

constexpr std::array kRecordedRuns{
    RecordedRun{"/api/replay", replay},
    RecordedRun{"/api/identify", identify},
    RecordedRun{"/api/cancelidentification", cancel_identification},
    RecordedRun{"/api/addidentified", add_identified},
};

/// What needs a session. `body` is a JSON object.
void answer_change(PageContext& context, const httplib::Request& request, const WebSession& session,
                   const json& body, httplib::Response& response) {
  if (request.path == "/api/logout") return log_out(context, request, session, response);
  if (request.path == "/api/stop") return stop_machine(context, session, response);
  for (const RecordedRun& asked : kRecordedRuns) {
    if (asked.path != request.path) continue;
    if (session.role < WebRole::Calibrate)
      return refuse_role(context, request, session, WebRole::Calibrate, response);
    return asked.answer(context, session, body, response);
  }
  for (const Change& asked : kChanges) {
    if (asked.path != request.path) continue;
    if (session.role < asked.role)
      return refuse_role(context, request, session, asked.role, response);
    return change(context, session, asked, body, response);
  }
  send_error(response, 404, "there is no such request");
}

}  // namespace

void answer_post(PageContext& context, const httplib::Request& request, const std::string& text,
                 httplib::Response& response) {
  if (!from_this_site(request)) {
    context.report.line(
        "origin " + request.remote_addr,
        fmt::format("{}: {} refused: it comes from another site, {}", peer_of(request),
                    request.path, request.get_header_value("Origin").substr(0, 80)));
    return send_error(response, 403, "refused: the request comes from another site");
  }
  const auto body = body_of(text);
  if (!body) return send_error(response, body.error());

  try {
    if (request.path == "/api/login") return log_in(context, request, *body, response);
    const auto session = session_of(context, request);
    if (!session) return send_error(response, 401, "log in first");
    if (request.get_header_value("X-CSRF-Token") != session->csrf)
      return send_error(response, 403, "refused: the header X-CSRF-Token is missing or wrong");
    answer_change(context, request, *session, *body, response);
  } catch (const json::exception& error) {
    send_error(response, 400, "request: " + daemon::cause_of(error));
  }
}

}  // namespace abbe::web
