#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "abbe/base/sha256.hpp"
#include "abbe/config/check_config.hpp"
#include "abbe/web/recording_list.hpp"
#include "assets.hpp"
#include "byte_range.hpp"
#include "connection_stream.hpp"
#include "page_context.hpp"
#include "responses.hpp"

namespace abbe::web {
namespace {

using nlohmann::json;

constexpr std::size_t kMostDownloads = 4;

const char* type_of(std::string_view name) {
  if (name.ends_with(".html")) return "text/html; charset=utf-8";
  if (name.ends_with(".css")) return "text/css; charset=utf-8";
  if (name.ends_with(".svg")) return "image/svg+xml";
  return "text/javascript; charset=utf-8";
}

/// False if there is no such file.
bool answer_asset(const std::string& path, httplib::Response& response) {
  const std::string_view name = path == "/" ? "index.html" : std::string_view{path}.substr(1);
  const auto files = assets();
  const auto file = std::ranges::find(files, name, &EmbeddedFile::name);
  if (file == files.end()) return false;
  // The browser asks each time, so that a new version of abbe-web is seen at once.
  response.headers.erase("Cache-Control");
  response.set_header("Cache-Control", "no-cache");
  send_asset(response, file->bytes, type_of(name));
  return true;
}

json me_json(PageContext& context, const std::optional<WebSession>& session) {
  const auto& web = context.options.settings.web;
  json out{{"may_view", session.has_value() || web.view_without_login},
           {"log_in", context.sessions.possible()}};
  if (!session) return out;
  out["user"] = session->user;
  out["role"] = name(session->role);
  out["csrf"] = session->csrf;
  return out;
}

json configuration_json(const PageContext& context) {
  const auto& file = context.options.config_file;
  json out{{"file", file.string()}};
  if (const auto hash = daemon::sha256_hex_of_file(file)) out["sha256"] = *hash;
  const auto checked =
      daemon::check_config(file, static_cast<int>(::sysconf(_SC_NPROCESSORS_CONF)));
  if (!checked) {
    out["faults"] = checked.error().details;
    if (checked.error().details.empty()) out["faults"] = {checked.error().text};
    return out;
  }
  out["understood"] = daemon::summary_of(checked->config);
  out["warnings"] = checked->warnings;
  return out;
}

void answer_report(PageContext& context, const std::string& id, httplib::Response& response) {
  // The report has its style in the markup, and neither scripts nor links.
  response.headers.erase("Content-Security-Policy");
  response.set_header("Content-Security-Policy",
                      "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox; "
                      "frame-ancestors 'none'");
  auto text = context.models.report(id);
  if (!text) return send_error(response, text.error());
  send_text(response, 200, std::move(*text), "text/html; charset=utf-8");
}

/// The part of the recording that the request asks for. A download that broke off goes on with the
/// rest, unless the recording is another one by now.
RangeAnswer range_of(const httplib::Request& request, const OpenRecording& file) {
  const bool is_other =
      request.has_header("If-Range") && request.get_header_value("If-Range") != file.etag;
  if (file.etag.empty() || request.method != "GET" || is_other ||
      request.get_header_value_count(kRangeHeader) != 1)
    return {};
  return range_answer(request.get_header_value(kRangeHeader), file.bytes);
}

/// One of the downloads that run at the same time, until it ends; null: kMostDownloads run.
std::shared_ptr<void> place_for_download(PageContext& context) {
  if (context.downloads.fetch_add(1) < kMostDownloads)
    return {&context.downloads, [](auto* downloads) { downloads->fetch_sub(1); }};
  context.downloads.fetch_sub(1);
  return nullptr;
}

void send_recording(httplib::Response& response, OpenRecording opened,
                    const std::optional<ByteRange>& part, std::shared_ptr<void> place) {
  if (!opened.etag.empty()) {
    response.set_header("Accept-Ranges", "bytes");
    response.set_header("ETag", opened.etag);
  }
  if (opened.bytes == 0) return send_text(response, 200, {}, "application/octet-stream");

  const ByteRange sent = part.value_or(ByteRange{0, opened.bytes});
  if (part)
    response.set_header("Content-Range", fmt::format("bytes {}-{}/{}", sent.first,
                                                     sent.first + sent.bytes - 1, opened.bytes));
  response.status = part ? 206 : 200;
  const auto file = std::make_shared<OpenRecording>(std::move(opened));
  response.set_content_provider(
      sent.bytes, "application/octet-stream",
      [file, place = std::move(place), first = sent.first](std::size_t offset, std::size_t length,
                                                           httplib::DataSink& sink) {
        std::string bytes(std::min<std::size_t>(length, 1u << 16), '\0');
        const ssize_t n =
            ::pread(file->fd.get(), bytes.data(), bytes.size(), static_cast<off_t>(first + offset));
        return n > 0 && sink.write(bytes.data(), static_cast<std::size_t>(n));
      });
}

void answer_download(PageContext& context, const httplib::Request& request, const std::string& name,
                     httplib::Response& response) {
  auto opened = open_recording(context.options.settings.config.recording.dir, name);
  if (!opened) return send_error(response, 404, opened.error().text);
  const RangeAnswer range = range_of(request, *opened);
  if (range.beyond_end) {
    response.set_header("Content-Range", fmt::format("bytes */{}", opened->bytes));
    return send_error(response, 416,
                      fmt::format("recording {}: it has {} bytes", name, opened->bytes));
  }
  auto place = place_for_download(context);
  if (place == nullptr) {
    context.report.line("downloads", fmt::format("{}: download of {} refused: {} are running",
                                                 peer_of(request), name, kMostDownloads));
    return send_error(response, 503, "too many downloads are running: try again later");
  }
  response.set_header("Content-Disposition", fmt::format("attachment; filename=\"{}\"", name));
  send_recording(response, std::move(*opened), range.part, std::move(place));
}

/// The part of the path behind `prefix`; nullopt if it has another beginning.
std::optional<std::string> behind(const std::string& path, std::string_view prefix) {
  if (!path.starts_with(prefix)) return std::nullopt;
  return path.substr(prefix.size());
}

/// A page reports that it reads its events, with the number of the event "place".
void answer_reading(PageContext& context, const std::string& text, httplib::Response& response) {
  std::uint64_t number = 0;
  const char* const end = text.data() + text.size();
  if (const auto read = std::from_chars(text.data(), end, number);
      read.ec != std::errc{} || read.ptr != end)
    return send_error(response, 400, "/api/reading/NUMBER: the number of an event \"place\"");
  context.pages.report_reading(number, std::chrono::steady_clock::now());
  send_json(response, json::object());
}

/// "5min" or "5min/NUMBER": a window of the curves, from the bucket of this number on.
void answer_curves(const PageContext& context, const std::string& text,
                   httplib::Response& response) {
  const auto slash = text.find('/');
  std::int64_t since = 0;
  if (slash != std::string::npos) {
    const char* const end = text.data() + text.size();
    const auto read = std::from_chars(text.data() + slash + 1, end, since);
    if (read.ec != std::errc{} || read.ptr != end)
      return send_error(response, 400, "/api/curves/WINDOW/NUMBER: the number of a bucket");
  }
  auto answer =
      context.feed.curves().window(text.substr(0, slash), since, std::chrono::steady_clock::now());
  if (!answer) return send_error(response, 404, "/api/curves/WINDOW: 5min, 1h or 8h");
  send_text(response, 200, std::move(*answer), "application/json");
}

/// The model of the last identification, also if it is not in the store.
void answer_identified(const PageContext& context, httplib::Response& response) {
  auto model = context.identifications.model();
  if (!model) return send_error(response, 404, model.error().text);
  response.set_header("Content-Disposition", "attachment; filename=\"model.json\"");
  send_text(response, 200, std::move(model->text), kJson);
}

/// False if there is no such path.
bool answer_data(PageContext& context, const httplib::Request& request,
                 httplib::Response& response) {
  const std::string& path = request.path;
  if (path == "/events") {
    answer_events(context, request, response);
  } else if (const auto number = behind(path, "/api/reading/")) {
    answer_reading(context, *number, response);
  } else if (path == "/api/status") {
    send_json(response, context.feed.status());
  } else if (path == "/api/calibration") {
    send_json(response, context.feed.calibration());
  } else if (const auto window = behind(path, "/api/curves/")) {
    answer_curves(context, *window, response);
  } else if (path == "/api/history") {
    send_result(response, context.models.history());
  } else if (path == "/api/trend") {
    send_result(response, context.models.trend());
  } else if (path == "/api/recordings") {
    send_result(response, recordings_json(context.options.settings.config.recording.dir));
  } else if (path == "/api/configuration") {
    send_json(response, configuration_json(context));
  } else if (path == "/api/replay") {
    send_json(response, context.replays.status());
  } else if (path == "/api/identify") {
    send_json(response, context.identifications.status());
  } else if (path == "/identified/model.json") {
    answer_identified(context, response);
  } else if (const auto id = behind(path, "/api/models/")) {
    send_result(response, context.models.model(*id));
  } else if (const auto of_report = behind(path, "/reports/")) {
    answer_report(context, *of_report, response);
  } else if (const auto of_file = behind(path, "/models/")) {
    response.set_header("Content-Disposition", "attachment; filename=\"model.json\"");
    send_result(response, context.models.model_file(*of_file));
  } else if (const auto recording = behind(path, "/recordings/")) {
    answer_download(context, request, *recording, response);
  } else {
    return false;
  }
  return true;
}

}  // namespace

void answer_get(PageContext& context, const httplib::Request& request,
                httplib::Response& response) {
  if (answer_asset(request.path, response)) return;
  // The page marks what it asks although nobody has touched it for a minute. The browser opens the
  // stream of events again by itself.
  const bool unattended = request.has_header("X-Unattended") || request.path == "/events";
  const auto session =
      session_of(context, request, unattended ? SessionUse::Look : SessionUse::Request);
  if (request.path == "/api/me") return send_json(response, me_json(context, session));
  if (!session && !context.options.settings.web.view_without_login)
    return send_error(response, 401, "log in first");
  if (!answer_data(context, request, response)) send_error(response, 404, "there is no such page");
}

}  // namespace abbe::web
