#include "abbe/methods/calibration_request.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/messages/attachment_content.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

// Beginning of the text of an attachment. The number after this key has a fixed width, so that
// set_from() can replace it in place.
constexpr std::string_view kFromKey = R"({"from_ns":)";
constexpr std::size_t kDigitsOfFrom = 20;

}  // namespace

std::string_view method_of(const CalibrationTask& task) noexcept {
  return Methods::visit(task, [](auto method, const auto&) { return method.kName; });
}

json to_json(const CalibrationTask& task) {
  json out = Methods::visit(
      task, [](auto method, const auto& request) { return method.to_json(request); });
  out["method"] = method_of(task);
  return out;
}

Result<CalibrationTask> task_from_json(const json& object, const Config* config) {
  try {
    const auto name = object.at("method").get<std::string>();
    std::optional<CalibrationTask> task;
    Methods::for_each([&](auto method) {
      if (name == method.kName) task = method.request_from(object, config);
    });

    if (task) return std::move(*task);
    return fail(ErrorCode::Usage, fmt::format("calibrate: unknown method \"{}\", known: \"{}\"",
                                              name, fmt::join(Methods::kNames, "\", \"")));
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput, fmt::format("calibrate: {}", cause_of(e)));
  }
}

RecordingAttachment to_attachment(const CalibrationRequest& request) {
  auto attachment = to_attachment(request.task);
  set_from(attachment, request.from);
  return attachment;
}

RecordingAttachment to_attachment(const CalibrationTask& task) {
  std::string content = json_text(to_json(task));
  content.replace(0, 1, fmt::format("{}{:{}},", kFromKey, 0, kDigitsOfFrom));
  return {.name = fmt::format("{}{}{}", kRequestNamePrefix, method_of(task), kRequestNameSuffix),
          .media_type = "application/json",
          .content = std::move(content)};
}

void set_from(RecordingAttachment& attachment, protocol::HostTime from) noexcept {
  char* const place = attachment.content.data() + kFromKey.size();
  std::fill_n(place, kDigitsOfFrom, ' ');  // JSON allows spaces before and after a number
  (void)std::to_chars(place, place + kDigitsOfFrom, from.time_since_epoch().count());
}

Result<CalibrationRequest> from_attachment(const RecordingAttachment& attachment) {
  try {
    const auto parsed = content_of(attachment);
    ABBE_TRY(parsed);
    const json& content = *parsed;
    const protocol::HostTime from{
        std::chrono::nanoseconds{content.at("from_ns").get<std::int64_t>()}};
    auto task = task_from_json(content);
    if (!task)
      return fail(ErrorCode::BadInput,
                  fmt::format("attachment {}: {}", attachment.name, task.error().text));
    CalibrationRequest request;
    request.task = std::move(*task);
    request.from = from;
    return request;
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput,
                fmt::format("attachment {}: {}", attachment.name, cause_of(e)));
  }
}

}  // namespace abbe::daemon
