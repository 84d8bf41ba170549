#include "abbe/tasks/verification_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "abbe/base/local_time.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/verify/expanded_uncertainty.hpp"
#include "abbe/report/html_report.hpp"
#include "abbe/report/sections.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;
constexpr std::array<const char*, 3> kNames{"x", "y", "z"};

std::string mm(const calib::Vector3& p_m) {
  return fmt::format("{:.3f}, {:.3f}, {:.3f} mm", kMmPerM * p_m.x(), kMmPerM * p_m.y(),
                     kMmPerM * p_m.z());
}

std::string urad(const calib::Vector3& r_rad) {
  return fmt::format("{:.1f}, {:.1f}, {:.1f} urad", kUradPerRad * r_rad.x(),
                     kUradPerRad * r_rad.y(), kUradPerRad * r_rad.z());
}

std::vector<double> lengths_um(const std::vector<calib::Vector3>& v_m) {
  std::vector<double> out;
  out.reserve(v_m.size());
  for (const auto& v : v_m) out.push_back(kUmPerM * v.norm());
  return out;
}

const char* words(verify::Effect effect) {
  switch (effect) {
    case verify::Effect::Better:
      return "better with the model";
    case verify::Effect::NotSeen:
      return "neither better nor worse with the model";
    case verify::Effect::Worse:
      return "WORSE with the model: do not use it";
  }
  return "";
}

std::size_t places_improved(const verify::Comparison& c) {
  std::size_t improved = 0;
  for (std::size_t i = 0; i < c.inside.size(); ++i)
    improved += c.residual_after_m[i].norm() < c.residual_before_m[i].norm() ? 1 : 0;
  return improved;
}

void add_identity(HtmlReport& page, const Verification& v) {
  const ModelDocument& document = v.models.front().model.document;
  const std::string measured = v.inputs.empty() ? "at the running machine" : v.inputs.front().name;
  const CertificateDetails& d = v.details;
  const VerificationDetails& of = d.verification;
  page.begin_columns();
  page.facts({{"machine", shortened(document.machine)},
              {"serial number", stated(d.machine_serial, "machine.serial")},
              {"certificate", stated(d.number, "certificate.number")},
              {"customer", stated(d.customer.name, "customer.name")},
              {"model", model_id(document)},
              {"model identified", local_time_text(document.created)}});
  page.facts({{"measured", stated(of.date, "verification.date")},
              {"operator", stated(of.operator_name, "verification.operator")},
              {"instrument", stated(instruments_of(d, EquipmentUse::Verification),
                                    "equipment.name, used = \"verification\"")},
              {"temperature", of.temperature_C ? fmt::format("{:g} C", *of.temperature_C)
                                               : "not stated (verification.temperature_C)"},
              {"measured points", shortened(measured)}});
  page.end_columns();
  page.paragraph(
      "Keys in parentheses are those of certificate.toml: abbe verify MODEL --details "
      "certificate.toml.");
}

bool in_doubt(const Verification& v) {
  return !v.likely_mistakes.empty() || !v.cut_short.empty();
}

void add_tolerance(HtmlReport& page, const Verification& v) {
  page.heading("Tolerance");
  const auto judged = judged_residuals(v);
  if (judged.empty())
    return page.paragraph(
        "No limit is stated (verification.limit_rms_um, limit_max_um): neither pass nor fail.");

  std::vector<std::vector<std::string>> rows;
  for (const JudgedResidual& one : judged)
    rows.push_back({one.name + " of the residuals with the model",
                    fmt::format("{:.2f} \u00b1 {:.2g} um", one.value_um, one.U_um),
                    fmt::format("{:g} um", one.limit_um), std::string{name(one.conformity)}});
  page.table({"", "value \u00b1 U (95 %)", "limit", "verdict"}, rows);
  if (in_doubt(v))
    page.paragraph("No pass: a mistake in the file is likely, or points are missing (verdict).");
  page.paragraph(fmt::format(
      "Guard band of ISO 14253-1: pass if value + U is within the limit, fail if value - U is "
      "beyond it. U from u = {:g} um of each measured coordinate.",
      *v.details.verification.u_um));
}

void add_verdict(HtmlReport& page, const Verification& v) {
  page.heading("Verdict");
  page.paragraph(verdict_text(v.comparison()) + ".");
  if (!v.cut_short.empty()) page.paragraph("Points are missing: " + v.cut_short + ".");
  for (const std::string& mistake : v.likely_mistakes)
    page.paragraph("A mistake in the file is likely: the points fit far better with " + mistake +
                   ".");
  for (const std::string& point : v.points_off) page.paragraph("One point: " + point + ".");
  if (v.repeated > 0)
    page.paragraph(fmt::format(
        "{} rows repeat another row in every digit and count once: where they are shots of their "
        "own, the repeatability is smaller than stated.",
        v.repeated));
  for (const std::string& caution : v.models.front().model.cautions)
    page.paragraph("Of the model: " + caution + ".");
}

void add_left(HtmlReport& page, const Verification& v) {
  const auto& c = v.comparison();
  page.heading("Residuals at the measured places");
  page.paragraph(fmt::format(
      "{}. {} of these places are in the volume where the model is valid. The shots of one place "
      "count as one place, with their mean, because errors that they have in common do not average "
      "out. Each row is computed after the rigid motion of the instrument that fits it best.",
      shots_text(v.observations), c.inside.size()));

  const auto row = [](const char* what, const calib::VectorStatistics& s) {
    return std::vector<std::string>{what, um_text(s.mean_m), um_text(s.rms_m), um_text(s.max_m)};
  };

  page.table({"", "mean", "rms", "largest"},
             {row("without compensation", c.before), row("with the model", c.after)});
  page.plot(Histogram{"residuals at the measured places",
                      "um",
                      {{"without compensation", lengths_um(c.residual_before_m)},
                       {"with the model", lengths_um(c.residual_after_m)}}});
}

/// The lines of a place: "line 9", "lines 9, 12, 40", "lines 9, 12, 40, 41 ... (7 shots)".
std::string place_text(const Verification& v, std::size_t place) {
  constexpr std::size_t kShown = 4;
  const auto& shots = v.observations.shots[place];
  std::string numbers;
  for (std::size_t i = 0; i < std::min(kShown, shots.size()); ++i)
    numbers +=
        fmt::format("{}{}", i == 0 ? "" : ", ", v.lines.empty() ? shots[i] + 1 : v.lines[shots[i]]);
  return fmt::format("{}{} {}{}", v.lines.empty() ? "point" : "line", shots.size() > 1 ? "s" : "",
                     numbers,
                     shots.size() > kShown ? fmt::format(" ... ({} shots)", shots.size()) : "");
}

/// Adds a table of the places with the largest residuals, which shows a single wrong row of the
/// file, for example after the beam was interrupted.
void add_farthest(HtmlReport& page, const Verification& v) {
  constexpr std::size_t kShown = 5;
  const auto& c = v.comparison();
  std::vector<std::size_t> order(c.inside.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto shown = static_cast<std::ptrdiff_t>(std::min(kShown, order.size()));

  std::partial_sort(order.begin(), order.begin() + shown, order.end(),
                    [&](std::size_t a, std::size_t b) {
                      return c.residual_after_m[a].norm() > c.residual_after_m[b].norm();
                    });

  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < static_cast<std::size_t>(shown); ++i) {
    const std::size_t place = c.inside[order[i]];
    rows.push_back({place_text(v, place), mm(v.observations.readings_m[place]),
                    um_text(c.residual_after_m[order[i]].norm())});
  }

  page.table({"largest residuals", "reading", "residual"}, rows);
}

void add_frame(HtmlReport& page, const Verification& v) {
  const auto& o = v.observations;
  const auto& c = v.comparison();
  page.heading("Frames");
  page.paragraph(
      o.frame == verify::Frame::BestFit
          ? "The position and orientation of the instrument are known only from these points: its "
            "frame was fitted to the readings. The fit removes from V_las the rigid motion that "
            "fits it best (six numbers). The comparison therefore shows the shape of the volume "
            "only, not its position or rotation."
          : "The instrument's axes were given as those of the machine: V_las keeps its rotation.");
  page.paragraph(
      "\"As stated\" compares with V of the unchanged model. \"Turned\" first applies to the model "
      "the small rigid motion that fits V_las best, so that only shapes are compared. A model from "
      "a ball array without rotation reference, and any model in a fitted frame, can only be "
      "judged by \"turned\".");
  const Eigen::Quaterniond q(o.T_machine_tracker.R);
  page.facts({{"instrument in the machine", mm(o.T_machine_tracker.t_m)},
              {"its rotation (quaternion w, x, y, z)",
               fmt::format("{:.9f}, {:.9f}, {:.9f}, {:.9f}", q.w(), q.x(), q.y(), q.z())},
              {"origin, where V is set to zero",
               c.origin_m ? mm(*c.origin_m) : std::string{"none: the means are subtracted"}},
              {"model turned by (rotation about the origin)", urad(c.turned.tail<3>())},
              {"grid: multiples of", mm(c.step_m)},
              {"points are left out if nearer to the origin than",
               fmt::format("{:.1f} mm", kMmPerM * c.least_distance_m)},
              {"error of interpolating V_las linearly (computed on the model)",
               um_text(c.interpolation_rms_m) + " rms"}});
}

std::vector<std::string> ratio_row(const char* what, const verify::RatioStatistics& s) {
  const auto text = [](double x) { return fmt::format("{:.3f}", x); };
  return {what,
          std::to_string(s.count),
          text(s.mean),
          text(s.standard_deviation),
          text(s.min),
          text(s.p25),
          text(s.median),
          text(s.p75),
          text(s.max),
          fmt::format("{} ({:.1f} %)", s.above_1,
                      100.0 * static_cast<double>(s.above_1) / static_cast<double>(s.count))};
}

void add_ratio(HtmlReport& page, const verify::Comparison& c) {
  page.heading("R_resmag: residual relative to the measured vector");
  if (const auto why = why_no_ratio(c)) return page.paragraph("Not given: " + *why + ".");
  page.paragraph(
      "|V_las - V_model| / |V_las| on a grid inside the model's volume; below 1 the model reduces "
      "the error, above 1 it increases it [Li OMM, eqs. 20, 21]. Section \"Frames\" explains "
      "\"turned\" and \"as stated\", and why the latter may be near 1 for a good model.");
  page.table({"", "points", "mean", "std", "min", "25 %", "median", "75 %", "max", "above 1"},
             {ratio_row("turned", c.R_turned), ratio_row("as stated", c.R_stated)});
  std::vector<double> stated, turned;

  for (const auto& g : c.grid) {
    stated.push_back(g.R_stated);
    turned.push_back(g.R_turned);
  }

  page.plot(Histogram{"R_resmag, turned", "R_resmag", {{"turned", turned}}});
  page.plot(Histogram{"R_resmag, as stated", "R_resmag", {{"as stated", stated}}});
}

/// The largest number not above `x` (positive) that is 1, 2 or 5 times a power of ten.
double round_number(double x) {
  const double ten = std::pow(10.0, std::floor(std::log10(x)));
  for (const double digit : {5.0, 2.0})
    if (digit * ten <= x) return digit * ten;
  return ten;
}

struct Plane {
  Eigen::Index across = 2, right = 0, up = 1;
  double at_m = 0.0;
  std::vector<const verify::GridPoint*> points;
};

/// The layer of the grid that is nearest to `wanted_m`.
Plane plane_of(const verify::Comparison& c, Eigen::Index across, double wanted_m) {
  Plane plane{.across = across, .right = across == 0 ? 1 : 0, .up = across == 2 ? 1 : 2};
  const auto nearest =
      std::min_element(c.grid.begin(), c.grid.end(), [&](const auto& a, const auto& b) {
        return std::abs(a.q_m(across) - wanted_m) < std::abs(b.q_m(across) - wanted_m);
      });
  plane.at_m = nearest->q_m(across);
  for (const auto& g : c.grid)
    if (std::abs(g.q_m(across) - plane.at_m) < 0.5 * c.step_m(across)) plane.points.push_back(&g);
  return plane;
}

using VectorAt = calib::Vector3 (*)(const verify::GridPoint&);

void add_vectors(HtmlReport& page, const Plane& plane, const char* name, double magnification,
                 VectorAt at) {
  VectorChart chart{.title = fmt::format("{}, {} = {:.3f} mm, arrows x {:g}", name,
                                         kNames[static_cast<std::size_t>(plane.across)],
                                         kMmPerM * plane.at_m, magnification),
                    .x_label = fmt::format("{}, mm", kNames[static_cast<std::size_t>(plane.right)]),
                    .y_label = fmt::format("{}, mm", kNames[static_cast<std::size_t>(plane.up)]),
                    .name = name,
                    .arrows = {},
                    .magnification = magnification};

  for (const auto* g : plane.points) {
    const calib::Vector3 v = kMmPerM * at(*g);
    chart.arrows.push_back(
        {kMmPerM * g->q_m(plane.right), kMmPerM * g->q_m(plane.up), v(plane.right), v(plane.up)});
  }

  page.plot(chart);
}

/// Adds charts of measured vectors, model and residual in planes normal to z, x and y, as in Fig.
/// 12 of [Li OMM].
void add_planes(HtmlReport& page, const Verification& v) {
  const auto& c = v.comparison();
  calib::Vector3 low = c.grid.front().q_m, high = low;
  double longest_m = 1e-9;

  for (const auto& g : c.grid) {
    low = low.cwiseMin(g.q_m);
    high = high.cwiseMax(g.q_m);
    longest_m = std::max(longest_m, g.V_las_m.norm());
  }

  const calib::Vector3 wanted = v.planes_m.value_or(0.5 * (low + high));
  constexpr double kLongestArrow = 0.1;  // fraction of the diagonal of the volume
  const double magnification = round_number(kLongestArrow * (high - low).norm() / longest_m);
  page.heading("Vectors in three planes");
  page.paragraph(
      "Arrows from each reading (dot) towards the true position: measured, from the turned model, "
      "and the residual (their difference), all at the same scale.");

  for (const Eigen::Index across : {2, 0, 1}) {
    const Plane plane = plane_of(c, across, wanted(across));
    add_vectors(page, plane, "measured", magnification, [](const auto& g) { return g.V_las_m; });
    add_vectors(page, plane, "model", magnification, [](const auto& g) { return g.turned_m; });
    add_vectors(page, plane, "residual", magnification,
                [](const auto& g) -> calib::Vector3 { return g.V_las_m - g.turned_m; });
  }
}

}  // namespace

std::vector<JudgedResidual> judged_residuals(const Verification& v) {
  const VerificationDetails& of = v.details.verification;
  if (!of.u_um) return {};
  const auto& after = v.comparison().after;
  const auto U = verify::expanded_uncertainty(*of.u_um / kUmPerM, v.inside);
  std::vector<JudgedResidual> judged;
  const auto judge = [&judged, &v](const char* name, double value_m, double U_m,
                                   const std::optional<double>& limit_um) {
    if (!limit_um) return;
    const double value_um = kUmPerM * value_m, U_um = kUmPerM * U_m;
    auto conformity = conformity_of(value_um, U_um, *limit_um);
    if (conformity == Conformity::Pass && in_doubt(v)) conformity = Conformity::Neither;
    judged.push_back({name, value_um, U_um, *limit_um, conformity});
  };
  judge("rms", after.rms_m, U.rms_m, of.limit_rms_um);
  judge("largest", after.max_m, U.max_m, of.limit_max_um);
  return judged;
}

std::string verdict_text(const verify::Comparison& c) {
  return fmt::format("{}: {:.3f} um rms left, {:.3f} um without it; {} of {} places improved",
                     words(verify::effect_at_points(c)), kUmPerM * c.after.rms_m,
                     kUmPerM * c.before.rms_m, places_improved(c), c.inside.size());
}

std::string shots_text(const verify::Observations& o) {
  const std::size_t shots = o.shot_count(), places = o.shots.size();
  if (!o.repeatability_m) return fmt::format("{} places, one shot each", places);
  const auto [fewest, most] =
      std::ranges::minmax(o.shots, {}, [](const auto& of_place) { return of_place.size(); });
  return fmt::format(
      "{} shots at {} places, {} to {} each; their standard deviation about the means of their "
      "places is {:.2f} um (3-D)",
      shots, places, fewest.size(), most.size(), kUmPerM * *o.repeatability_m);
}

std::optional<std::string> why_no_ratio(const verify::Comparison& c) {
  if (verify::ratios_hold(c)) return std::nullopt;
  return fmt::format(
      "the error of interpolating between the measured points, {:.3f} um rms, is not small against "
      "the residual of {:.3f} um rms; measure more points at smaller distances",
      kUmPerM * c.interpolation_rms_m, kUmPerM * c.after.rms_m);
}

std::string verification_report(const Verification& v) {
  const ModelDocument& document = v.models.front().model.document;
  HtmlReport page(fmt::format("{}: verification of a model", document.machine));
  add_footer(page, document);
  page.begin_front();
  add_identity(page, v);
  add_verdict(page, v);
  add_tolerance(page, v);
  add_left(page, v);
  add_signature(page, signed_by(v.details), v.details.issue_date);
  page.end_front();
  page.page_break();
  add_farthest(page, v);
  add_ratio(page, v.comparison());
  add_planes(page, v);
  add_frame(page, v);
  add_model_origin(page, document, v.inputs);
  return page.text();
}

std::string to_grid_csv(const verify::Comparison& c) {
  std::string text = "x_mm,y_mm,z_mm";
  for (const char* source : {"las", "model", "turned"})
    for (const char* axis : kNames) text += fmt::format(",{}_{}_um", source, axis);
  text += ",R_stated,R_turned\n";
  for (const auto& g : c.grid) {
    for (Eigen::Index i = 0; i < 3; ++i) text += fmt::format("{:.17g},", kMmPerM * g.q_m(i));
    for (const auto* v : {&g.V_las_m, &g.stated_m, &g.turned_m})
      for (Eigen::Index i = 0; i < 3; ++i) text += fmt::format("{:.17g},", kUmPerM * (*v)(i));
    text += fmt::format("{:.17g},{:.17g}\n", g.R_stated, g.R_turned);
  }
  return text;
}

}  // namespace abbe::daemon
