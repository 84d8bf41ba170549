#pragma once
/// What the routes of the server share.

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>

#include "abbe/base/limited_log.hpp"
#include "abbe/web/certificate.hpp"
#include "abbe/web/daemon_feed.hpp"
#include "abbe/web/event_board.hpp"
#include "abbe/web/identifications.hpp"
#include "abbe/web/model_views.hpp"
#include "abbe/web/page_places.hpp"
#include "abbe/web/page_server.hpp"
#include "abbe/web/replays.hpp"
#include "abbe/web/sessions.hpp"
#include "http.hpp"
#include "request_rate.hpp"

namespace abbe::web {

struct PageContext {
  explicit PageContext(PageOptions given)
      : options(std::move(given)),
        report(options.report, {.lines = 1, .period = std::chrono::seconds{10}}),
        models(options.settings.config.daemon.models_dir(),
               daemon::machine_hash(options.settings.config)),
        sessions(options.settings.web.users,
                 {.idle = seconds_of(options.settings.web.session_idle)},
                 [this](const std::string& line) { report.always(line); }),
        replays(options.settings.config.recording.dir,
                [this](const std::string& line) { report.always(line); }),
        identifications({.recordings = options.settings.config.recording.dir,
                         .models = options.settings.config.daemon.models_dir(),
                         .config_file = options.config_file},
                        [this](const std::string& line) { report.always(line); }),
        pages(options.settings.web.most_pages),
        certificate_until(until_of(options.settings.web)),
        feed(
            options.settings, board, [this] { return pages.taken(); },
            [this] { return notice(); }) {}
  /// Of the certificate with which the server started.
  static std::optional<std::chrono::sys_seconds> until_of(const daemon::WebConfig& web) {
    if (!web.tls()) return std::nullopt;
    const auto dates = read_certificate(web.certificate);
    return dates ? std::optional{dates->until} : std::nullopt;
  }
  /// PageServer::notice().
  [[nodiscard]] std::string notice() const {
    if (!certificate_until) return {};
    return certificate_notice(options.settings.web.certificate, *certificate_until,
                              std::chrono::system_clock::now());
  }
  static std::chrono::seconds seconds_of(std::chrono::nanoseconds time) {
    return std::chrono::duration_cast<std::chrono::seconds>(time);
  }

  PageOptions options;
  daemon::LimitedLog report;
  RequestRate rate{kRequestsPerSecond, kRequestsAtOnce};
  EventBoard board;
  ModelViews models;
  Sessions sessions;
  Replays replays;
  Identifications identifications;
  PagePlaces pages;
  std::atomic<std::size_t> downloads{0};
  std::atomic<int> port{0};
  std::mutex changing;   // one change of a user at a time reaches abbed
  std::mutex beginning;  // of a replay or an identification, of which one runs at a time
  std::atomic<bool> stopping{false};
  std::optional<std::chrono::sys_seconds> certificate_until;  ///< nullopt: no TLS
  DaemonFeed feed;  // last: its thread uses the members above
};

/// Cookies are of a computer, not of a port: the name has the port, for two pages on one computer.
[[nodiscard]] std::string cookie_name(const PageContext& context);
/// "127.0.0.1:43210"
[[nodiscard]] std::string peer_of(const httplib::Request& request);
/// The session of the cookie; nullopt: not logged in.
[[nodiscard]] std::optional<WebSession> session_of(PageContext& context,
                                                   const httplib::Request& request,
                                                   SessionUse use = SessionUse::Request);

/// Answers GET and HEAD.
void answer_get(PageContext& context, const httplib::Request& request, httplib::Response& response);
/// Answers POST: log in, log out, and changes.
void answer_post(PageContext& context, const httplib::Request& request, const std::string& body,
                 httplib::Response& response);
/// The stream of events of one page.
void answer_events(PageContext& context, const httplib::Request& request,
                   httplib::Response& response);

}  // namespace abbe::web
