#include "abbe/web/identifications.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <system_error>
#include <type_traits>
#include <variant>

#include "abbe/model/model_document.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/identify_again.hpp"
#include "abbe/web/recording_list.hpp"
#include "early_end.hpp"
#include "identification_request.hpp"
#include "task_failure.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using nlohmann::json;

/// Sets the recording, the file of the configuration (empty: the recorded one) and the store.
void set_files(daemon::AgainArguments& arguments, const std::string& recording,
               const std::string& machine, const std::string& store) {
  std::visit(
      [&](auto& of_method) {
        if constexpr (std::is_same_v<std::decay_t<decltype(of_method)>,
                                     daemon::IdentifyEvemuArguments>) {
          of_method.input.recording = recording;
          of_method.input.machine = machine;
        } else {
          of_method.recording = recording;
          of_method.machine = machine;
        }
        of_method.keep = store;
      },
      arguments);
}

/// The file loses the end ".part" when it is closed: it has the one name or the other.
Result<std::string> present_name(const std::filesystem::path& folder, const std::string& name) {
  constexpr std::string_view kOpen = ".part";
  const auto opened = open_recording(folder, name);
  if (opened) return name;
  const std::string other = name.ends_with(kOpen) ? name.substr(0, name.size() - kOpen.size())
                                                  : name + std::string{kOpen};
  if (open_recording(folder, other)) return other;
  return tl::unexpected(opened.error());
}

json result_of(const daemon::IdentifiedAgain& identified, const std::string& id) {
  const daemon::ModelVerdict& verdict = *identified.document.verdict;
  return {{"id", id},
          {"accepted", verdict.accepted},
          {"reasons", verdict.reasons},
          {"notes", verdict.notes},
          {"figures", identified.figures},
          {"simulated", daemon::made_on_simulated_devices(identified.document).value_or(false)}};
}

}  // namespace

struct Identifications::Task {
  IdentificationRequest request;
  std::string user;
};

Result<void> Identifications::begin(const json& body, const std::string& user) {
  auto request = identification_request(body);
  ABBE_TRY(request);
  auto name = present_name(files_.recordings, request->recording);
  ABBE_TRY(name);
  request->recording = std::move(*name);
  std::error_code unknown;
  const bool has_store = std::filesystem::exists(files_.models, unknown);
  set_files(request->arguments, files_.recordings / request->recording,
            request->present_configuration ? files_.config_file.string() : "",
            has_store ? files_.models.string() : "");

  const json subject{{"name", request->recording},
                     {"method", body.at("method")},
                     {"options", request->options},
                     {"user", user}};
  const std::lock_guard lock(mutex_);
  ABBE_TRY(thread_.begin(
      subject, [this, task = Task{std::move(*request), user}] { return outcome_of(task); }));
  cancelled_by_.clear();
  last_ = {};
  added_.clear();
  return {};
}

Result<void> Identifications::cancel(const std::string& user) {
  const std::lock_guard lock(mutex_);
  if (!thread_.running()) return daemon::fail(ErrorCode::Refused, "no identification is running");
  cancelled_by_ = user;
  return {};
}

std::string Identifications::end_wanted() const {
  if (stopping_) return "abbe-web stops: the identification was ended";
  const std::lock_guard lock(mutex_);
  return cancelled_by_.empty() ? std::string{} : fmt::format("cancelled by {}", cancelled_by_);
}

json Identifications::outcome_of(const Task& task) {
  EarlyEnd early("identification", limits_, [this] { return end_wanted(); });
  const daemon::Progress progress(
      [this](std::string_view step, double share) {
        thread_.update({{"step", step}, {"progress", share}});
      },
      [&early] { return early.wanted(); });
  auto identified = daemon::identify_again(task.request.arguments, progress);
  if (early.reason()) return failed_with(*early.reason());
  if (std::string why = end_wanted(); !why.empty()) return failed_with(std::move(why));
  if (!identified) return failed_with(failure_text(identified.error()));

  daemon::ModelDocument& document = identified->document;
  if (!task.request.accept.empty())
    document.verdict->notes.push_back(fmt::format("{} accepted for this model: {}", task.user,
                                                  fmt::join(task.request.accept, ", ")));
  IdentifiedModel model{.id = model_id(document),
                        .text = to_json(document),
                        .from = fmt::format("identified again from {}{}{}", task.request.recording,
                                            task.request.options.empty() ? "" : ": ",
                                            fmt::join(task.request.options, ", "))};
  json result = result_of(*identified, model.id);
  const std::lock_guard lock(mutex_);
  last_ = std::move(model);
  return {{"state", "done"}, {"result", std::move(result)}};
}

json Identifications::status() const {
  json status = thread_.status();
  const std::lock_guard lock(mutex_);
  if (status.contains("result")) status["result"]["added"] = status["result"]["id"] == added_;
  return status;
}

Result<IdentifiedModel> Identifications::model(const std::string& id) const {
  const bool runs = running();
  const std::lock_guard lock(mutex_);
  if (runs || last_.id.empty())
    return daemon::fail(ErrorCode::Refused, runs ? "the identification is not done yet"
                                                 : "no model was identified again");
  if (!id.empty() && id != last_.id)
    return daemon::fail(
        ErrorCode::Refused,
        fmt::format("model {} was identified meanwhile: look at it first", last_.id));
  return last_;
}

void Identifications::note_added(const std::string& id) {
  const std::lock_guard lock(mutex_);
  added_ = id;
}

}  // namespace abbe::web
