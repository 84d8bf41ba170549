#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tasks/direction_option.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "commands.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

namespace {

struct ModelEvalArguments {
  std::string model, points, tool, direction;
  StoreOption store;
  bool correction = false;
};

/// One row of the output: position, error V or correction, its standard uncertainty, inside. The
/// correction is a function of V and has the same uncertainty.
Result<std::string> row(const calib::VolumetricModel& model, const AxisPosition& q,
                        const calib::Vector3& tool_m, const calib::AxisTravel& travel,
                        bool correction) {
  const calib::Vector3 position_m(q[0], q[1], q[2]);
  const auto error = model.error_at(position_m, tool_m, travel);
  calib::Vector3 vector_m = error.V_m;
  bool inside = error.inside;

  if (correction) {
    const auto found = model.command_correction(position_m, tool_m, travel);
    if (!found) return tl::make_unexpected(error_of(found.error()));
    vector_m = found->c_m;
    inside = found->inside;
  }

  std::string text;
  for (int i = 0; i < 3; ++i) text += fmt::format("{:.17g},", position_m[i] * kMmPerM);
  for (int i = 0; i < 3; ++i) text += fmt::format("{:.17g},", vector_m[i] * kUmPerM);
  for (int i = 0; i < 3; ++i)
    text += fmt::format("{:.17g},", std::sqrt(error.cov_V_m2(i, i)) * kUmPerM);

  return text + (inside ? "1\n" : "0\n");
}

/// The direction of travel at each point: of --direction, of the columns of points.csv, or unknown.
Result<std::vector<calib::AxisTravel>> travel_of(const ModelEvalArguments& arguments,
                                                 const PointsFile& points,
                                                 const calib::VolumetricModel& model) {
  const auto given = parse_direction(arguments.direction);
  ABBE_TRY(given);
  const bool of_points = !points.travel.empty();
  if (of_points && !arguments.direction.empty())
    return fail(ErrorCode::Usage,
                fmt::format("--direction: {} has the columns dx, dy, dz; give one of the two",
                            arguments.points));
  if (of_points || !arguments.direction.empty()) {
    ABBE_TRY(require_travel(model, arguments.model));
  }
  return of_points ? points.travel : std::vector(points.points_m.size(), *given);
}

Result<std::string> evaluate(const ModelEvalArguments& arguments) {
  const auto found = found_model(arguments.model, arguments.store);
  ABBE_TRY(found);
  const ModelDocument* const document = &found->document;
  const auto points = read_points_csv(arguments.points);
  ABBE_TRY(points);
  const auto tool_m = tool_of(arguments.tool, document->model);
  ABBE_TRY(tool_m);

  const auto travel = travel_of(arguments, *points, document->model);
  ABBE_TRY(travel);

  std::string text;
  print_cautions(arguments.model, *found);
  for (const std::string& caution : cautions_of(*found)) text += "# " + caution + "\n";
  text += arguments.correction ? "# quantity = command_correction\nx_mm,y_mm,z_mm,cx_um,cy_um,cz_um"
                               : "# quantity = error\nx_mm,y_mm,z_mm,ex_um,ey_um,ez_um";
  text += ",ux_um,uy_um,uz_um,inside\n";

  for (std::size_t i = 0; i < points->points_m.size(); ++i) {
    const auto line =
        row(document->model, points->points_m[i], *tool_m, (*travel)[i], arguments.correction);
    ABBE_TRY(line);
    text += *line;
  }

  return text;
}

int run(const ModelEvalArguments& arguments) {
  const auto text = evaluate(arguments);
  if (!text) return report(text.error());
  if (std::fwrite(text->data(), 1, text->size(), stdout) != text->size() ||
      std::fflush(stdout) != 0)
    return report({ErrorCode::Io, "write the result to stdout: it is closed or full"});
  return 0;
}

}  // namespace

void add_model_eval(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelEvalArguments>();
  auto* command =
      parent.add_subcommand("eval",
                            "Print the volumetric error at given axis positions as CSV to stdout.\n"
                            "e = actual - nominal at the scale reading; u: its standard "
                            "uncertainty (k = 1) in the model's datum;\n"
                            "inside: 1 if the position is in the validity volume of the model.");
  command->add_option("MODEL", arguments->model, kModelText)->required();
  add_store_options(*command, arguments->store);
  command
      ->add_option("--points", arguments->points,
                   "points.csv: x_mm,y_mm,z_mm, scale readings; dx,dy,dz (+, -, 0), if given: "
                   "direction of travel")
      ->required();
  command->add_option("--tool-mm", arguments->tool,
                      "x,y,z: tool offset in mm; default: that of the calibration");
  command->add_option("--direction", arguments->direction,
                      "direction in which X, Y and Z last moved, such as +,-,0 (0: not known), for "
                      "a model with backlash; default: not known, the mean of both directions");
  command->add_flag("--correction", arguments->correction,
                    "print the correction c to be added to a commanded position p instead: c = "
                    "-e(p + c), solved to 1 nm");
  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
