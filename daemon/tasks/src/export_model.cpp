#include "abbe/tasks/export_model.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>

#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/direction_option.hpp"
#include "abbe/tasks/output_files.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "export_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

/// A request with checked options.
struct ExportRequest {
  const FormatFacts* facts = nullptr;
  ModelDocument document;
  calib::Vector3 tool_m = calib::Vector3::Zero();
  calib::ExportBox box;
  calib::GridAxes nodes_m;
  /// --direction; nullopt: not given
  std::optional<calib::AxisTravel> travel;
  WriteOptions options;
};

std::string volume_text(const calib::ExportBox& box) {
  const calib::Vector3 low = kMmPerM * box.min_m, high = kMmPerM * box.max_m;
  return fmt::format("X {:.6g} to {:.6g}, Y {:.6g} to {:.6g}, Z {:.6g} to {:.6g} mm", low[0],
                     high[0], low[1], high[1], low[2], high[2]);
}

Result<void> add_direction(ExportRequest& request, const ExportArguments& arguments) {
  if (arguments.direction.empty()) return {};
  if (request.facts->holds != HeldPart::Grid)
    return fail(ErrorCode::Usage,
                fmt::format("--direction: {} is not a grid; its tables contain the directions that "
                            "it can hold",
                            request.facts->name));
  const auto travel = parse_direction(arguments.direction);
  ABBE_TRY(travel);
  ABBE_TRY(require_travel(request.document.model, arguments.model));
  request.travel = *travel;
  request.options.origin.direction = arguments.direction;
  return {};
}

Result<void> add_nodes(ExportRequest& request, const ExportArguments& arguments) {
  const auto part = volume_of(arguments.volume);
  ABBE_TRY(part);
  const auto& model = request.document.model;
  const auto box = calib::export_box(model, *part);
  if (!box) return fail(ErrorCode::Usage, "--volume-mm: " + box.error().text);
  request.box = *box;

  calib::NodeOptions options{.equidistant = request.facts->equidistant};
  if (arguments.step_mm) options.step_m = *arguments.step_mm / kMmPerM;
  const auto nodes = calib::export_nodes(model, *box, options);
  if (!nodes) return fail(ErrorCode::Usage, "--step-mm: " + nodes.error().text);
  request.nodes_m = *nodes;
  constexpr std::size_t kMostGridNodes = 1'000'000;
  const std::size_t count = (*nodes)[0].size() * (*nodes)[1].size() * (*nodes)[2].size();
  if (request.facts->holds == HeldPart::Grid && count > kMostGridNodes)
    return fail(ErrorCode::Usage,
                fmt::format("--step-mm: {} nodes of the grid; at most {}", count, kMostGridNodes));
  return {};
}

/// Checks the options. Options that need no model are checked first, so that a wrong one is
/// reported at once.
Result<ExportRequest> request_of(const ExportArguments& arguments,
                                 const ShowCautions& show_cautions) {
  const auto facts = format_of(arguments.to);
  ABBE_TRY(facts);
  const auto names = axis_names_of(arguments.axis_map, **facts);
  ABBE_TRY(names);
  const auto positive = positive_moves_of(arguments.positive, **facts);
  ABBE_TRY(positive);

  const auto forced = forced_by(arguments.force);
  ABBE_TRY(forced);
  auto named = found_model(arguments.model, arguments.store);
  ABBE_TRY(named);
  auto use = statements_of_use("export " + arguments.model,
                               obstacles_to_use(named->in_use(ModelPurpose::Control)), *forced);
  ABBE_TRY(use);
  show_cautions(arguments.model, *named);
  const auto tool_m = tool_of(arguments.tool, named->document.model);
  ABBE_TRY(tool_m);
  ExportRequest request{*facts, std::move(named->document), *tool_m, {}, {},
                        {},     {*names, *positive, {}}};
  ABBE_TRY(add_direction(request, arguments));
  ABBE_TRY(add_nodes(request, arguments));

  auto& origin = request.options.origin;
  origin.model_hash = model_hash(request.document);
  origin.use = *std::move(use);
  origin.machine = printable_line(request.document.machine);
  origin.volume = volume_text(request.box);
  const calib::Vector3 tool_mm = kMmPerM * *tool_m;
  origin.tool = fmt::format("({:.6g}, {:.6g}, {:.6g}) mm", tool_mm[0], tool_mm[1], tool_mm[2]);
  return request;
}

std::vector<calib::ErrorMotion> motions_of(HeldPart part) {
  return part == HeldPart::Positioning ? calib::positioning_motions()
                                       : calib::translation_motions();
}

calib::Result<HeldCorrection> held_by(const ExportRequest& request) {
  const auto& model = request.document.model;
  const auto& facts = *request.facts;
  if (facts.holds == HeldPart::Grid)
    return calib::grid_of_model(model, request.tool_m, request.nodes_m,
                                request.travel.value_or(calib::AxisTravel{}))
        .map([](auto grid) { return HeldCorrection(std::move(grid)); });
  if (facts.holds == HeldPart::Errors)
    return calib::tables_of_model(model, request.tool_m, request.nodes_m).map([](auto tables) {
      return HeldCorrection(std::move(tables));
    });
  return calib::fit_tables(model, request.tool_m, motions_of(facts.holds), request.nodes_m,
                           facts.per_direction)
      .map([](auto tables) { return HeldCorrection(std::move(tables)); });
}

calib::CorrectionFunction correction_function(const HeldCorrection& held) {
  return [&held](const calib::ExportPlace& place) -> calib::Vector3 {
    if (const auto* grid = std::get_if<calib::HeldGrid>(&held); grid != nullptr)
      return grid->c_m(place.commanded_m);
    return std::get<calib::HeldTables>(held).c_m(place.commanded_m, place.travel);
  };
}

/// DataInsufficient if the correction would not improve the machine.
Result<void> require_use(const ExportRequest& request, const calib::ExportLoss& loss) {
  constexpr double kNothing_m = 1e-9, kUseful = 0.99;
  const double without_m = loss.rms_without_m.norm(), lost_m = loss.rms_lost_m.norm();
  if (without_m < kNothing_m || lost_m < kUseful * without_m) return {};
  Error error{ErrorCode::DataInsufficient,
              fmt::format("{} cannot hold this model: of a correction of {:.3f} um rms it loses "
                          "{:.3f} um",
                          request.facts->name, without_m * kUmPerM, lost_m * kUmPerM)};
  error.details = {"isg-csv, etalon and csv-grid hold rotations and levers"};
  return tl::make_unexpected(error);
}

ControlSettings settings_of(const ExportRequest& request) {
  ControlSettings settings{request.options.axis_names, request.options.positive_moves, "", {}};
  for (const calib::Axis axis : request.document.model.chain().order_w_to_t())
    settings.order_w_to_t += calib::letter(axis);
  for (std::size_t k = 0; k < 3; ++k)
    settings.tool_m[k] = request.tool_m[static_cast<Eigen::Index>(k)];
  return settings;
}

Result<ExportReport> computed_report(const ExportRequest& request,
                                     std::span<const calib::ExportPlace> places) {
  auto held = held_by(request);
  if (!held) return tl::make_unexpected(error_of(held.error()));
  ExportReport report;
  report.facts = request.facts;
  report.written = request.options;
  report.held = *std::move(held);

  const auto& model = request.document.model;
  const auto loss = calib::export_loss(model, request.tool_m, places, request.travel,
                                       correction_function(report.held));
  if (!loss) return tl::make_unexpected(error_of(loss.error()));
  report.loss = *loss;
  ABBE_TRY(require_use(request, *loss));

  const auto part = request.facts->holds;
  if (part == HeldPart::Positioning || part == HeldPart::Translations) {
    auto by_error = calib::losses_by_error(model, request.tool_m, motions_of(part), request.box);
    if (!by_error) return tl::make_unexpected(error_of(by_error.error()));
    report.by_error = *std::move(by_error);
  }
  report.not_held = not_held_by(*request.facts, model, request.travel.has_value());
  return report;
}

/// The path of the report, which is in the same folder as the files, for a format with a folder.
fs::path report_path(const fs::path& folder) {
  return folder / "export.txt";
}

Result<void> write_files(const ExportRequest& request, const ExportArguments& arguments,
                         ExportReport& report, std::span<const calib::ExportPlace> places) {
  const auto files = write_export(request.facts->format, report.held, request.options);
  ABBE_TRY(files);
  const auto paths = final_paths(*request.facts, arguments.out, *files);
  const std::array<fs::path, 1> model{file_of_model(arguments.model, arguments.store)};
  auto written = paths;
  if (request.facts->folder) written.push_back(report_path(arguments.out));
  ABBE_TRY(require_own_files(model, written));
  const auto proof = write_when_proven(*files, paths, [&](std::span<const ExportFile> read) {
    return prove_export(request.facts->format, read, settings_of(request), places,
                        correction_function(report.held));
  });
  ABBE_TRY(proof);

  report.proof = *proof;
  for (const auto& path : paths) report.files.push_back(path.string());
  return {};
}

}  // namespace

Result<ExportReport> export_model(const ExportArguments& arguments,
                                  const ShowCautions& show_cautions) {
  const auto request = request_of(arguments, show_cautions);
  ABBE_TRY(request);
  const fs::path out = arguments.out;
  ABBE_TRY(require_place(*request->facts, out));
  constexpr std::uint32_t kSeed = 1;
  const auto places =
      calib::random_places(request->document.model, request->box, kExportPlaces, kSeed);
  if (!places) return tl::make_unexpected(error_of(places.error()));

  auto report = computed_report(*request, *places);
  if (!report) return report;
  ABBE_TRY(write_files(*request, arguments, *report, *places));
  if (request->facts->folder) {
    ABBE_TRY(replace_file(report_path(out), report_text(*report)));
  }
  return report;
}

}  // namespace abbe::daemon
