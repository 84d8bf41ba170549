#include "abbe/calib/environment/refractive_index.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"

namespace abbe::calib {
namespace {

constexpr double kZeroCelsius_K = 273.15;
constexpr double kGasConstant = 8.314472;   // J/(mol K), CODATA 2002
constexpr double kStandardCo2_ppm = 450.0;  // reference value of all three equations

double per_square_um(double wavelength_m) {
  const double um = wavelength_m * 1e6;
  return 1.0 / (um * um);
}

double vapour_pressure_Pa(const Air& air) {
  return air.relative_humidity * saturation_vapour_pressure_Pa(air.temperature_K);
}

/// Factor for (n - 1) of dry air for the CO2 content [Ciddor 1996] eq. (2).
double co2_factor(const Air& air) {
  return 1.0 + kCo2PerPpm * (air.co2_ppm - kStandardCo2_ppm);
}

/// Compressibility of moist air [Ciddor 1996] eq. (12).
double compressibility(double p_Pa, double T_K, double x_v) {
  const double t = T_K - kZeroCelsius_K;
  const double p_T = p_Pa / T_K;
  return 1.0 -
         p_T * (1.58123e-6 - 2.9331e-8 * t + 1.1043e-10 * t * t + (5.707e-6 - 2.051e-8 * t) * x_v +
                (1.9898e-4 - 2.376e-6 * t) * x_v * x_v) +
         p_T * p_T * (1.83e-11 - 0.765e-8 * x_v * x_v);
}

/// Refractive index n, [Ciddor 1996] appendix B.
double ciddor(const Air& air, double wavelength_m) {
  const double S = per_square_um(wavelength_m);
  const double T = air.temperature_K;
  const double t = T - kZeroCelsius_K;
  const double p = air.pressure_Pa;
  const double enhancement = 1.00062 + 3.14e-8 * p + 5.6e-7 * t * t;
  const double x_v = enhancement * vapour_pressure_Pa(air) / p;

  const double r_as = 1e-8 * (5792105.0 / (238.0185 - S) + 167917.0 / (57.362 - S));
  const double r_vs = 1.022e-8 * (295.235 + 2.6422 * S - 0.03238 * S * S + 0.004028 * S * S * S);
  const double r_axs = r_as * co2_factor(air);
  // molar mass of dry air in kg/mol
  const double M_a = 0.0289635 + 1.2011e-8 * (air.co2_ppm - 400.0);
  // molar mass of water vapour in kg/mol
  constexpr double kMolarVapour = 0.018015;
  // compressibility of dry air at 15 C and 101325 Pa
  constexpr double kStandardCompressibility = 0.9995922115;
  // density of water vapour in kg/m3 at 20 C and 1333 Pa
  constexpr double kVapourDensity = 0.00985938;

  const double rho_axs = 101325.0 * M_a / (kStandardCompressibility * kGasConstant * 288.15);
  const double ZRT = compressibility(p, T, x_v) * kGasConstant * T;
  const double rho_a = (1.0 - x_v) * p * M_a / ZRT;
  const double rho_v = x_v * p * kMolarVapour / ZRT;
  return 1.0 + rho_a / rho_axs * r_axs + rho_v / kVapourDensity * r_vs;
}

/// Refractive index by the modified Edlen equation [Birch & Downs 1993, 1994], which is for 450 ppm
/// of CO2; for another CO2 content the factor of [Ciddor 1996] is used.
double edlen(const Air& air, double wavelength_m) {
  const double S = per_square_um(wavelength_m);
  const double t = air.temperature_K - kZeroCelsius_K;
  const double p = air.pressure_Pa;
  const double n_s_minus_1 = 1e-8 * (8342.54 + 2406147.0 / (130.0 - S) + 15998.0 / (38.9 - S));
  const double X = (1.0 + 1e-8 * (0.601 - 0.00972 * t) * p) / (1.0 + 0.003661 * t);
  return 1.0 + co2_factor(air) * p * n_s_minus_1 * X / 96095.43 -
         1e-10 * (292.75 / (t + kZeroCelsius_K)) * (3.7345 - 0.0401 * S) * vapour_pressure_Pa(air);
}

double shop_floor(const Air& air) {
  const double t = air.temperature_K - kZeroCelsius_K;
  const double p_kPa = air.pressure_Pa * 1e-3;
  const double rh_percent = air.relative_humidity * 100.0;
  return 1.0 + 7.86e-4 * p_kPa / (273.0 + t) - 1.5e-11 * rh_percent * (t * t + 160.0);
}

double index_of(const Air& air, double wavelength_m, IndexEquation equation) {
  switch (equation) {
    case IndexEquation::Ciddor:
      return ciddor(air, wavelength_m);
    case IndexEquation::Edlen:
      return edlen(air, wavelength_m);
    case IndexEquation::ShopFloor:
      return shop_floor(air);
  }
  return 1.0;
}

/// Contribution of one input quantity to u_n: sensitivity coefficient times u, computed as
///     (n(value + u) - n(value - u)) / 2.
/// This is exact if n is linear in the quantity; for any realistic u the nonlinearity changes the
/// contribution by one part in 1000.
double share(Air air, double Air::*quantity, double u, double wavelength_m,
             IndexEquation equation) {
  const double value = air.*quantity;
  air.*quantity = value + u;
  const double up = index_of(air, wavelength_m, equation);
  air.*quantity = value - u;
  return 0.5 * (up - index_of(air, wavelength_m, equation));
}

/// Contribution of CO2 to u_n. The shop-floor formula does not contain CO2: the difference to 450
/// ppm is not corrected and is added in full.
double share_of_co2(const Air& air, double wavelength_m, IndexEquation equation) {
  if (equation != IndexEquation::ShopFloor)
    return share(air, &Air::co2_ppm, air.u_co2_ppm, wavelength_m, equation);
  return kCo2PerPpm * (shop_floor(air) - 1.0) *
         root_sum_of_squares(air.co2_ppm - kStandardCo2_ppm, air.u_co2_ppm);
}

struct Range {
  double min = 0.0, max = 0.0;
  [[nodiscard]] double mean() const { return 0.5 * (min + max); }
  // standard uncertainty of a rectangular distribution
  [[nodiscard]] double u() const { return 0.5 * (max - min) / std::numbers::sqrt3; }
};

bool within(double value, double min, double max) {
  return value >= min && value <= max;  // NaN gives false
}

}  // namespace

double saturation_vapour_pressure_Pa(double temperature_K) noexcept {
  constexpr std::array K{1167.05214528,   -724213.167032, -17.0738469401, 12020.8247025,
                         -3232555.03223,  14.9151086135,  -4823.26573616, 405113.405421,
                         -0.238555575678, 650.175348448};
  const double O = temperature_K + K[8] / (temperature_K - K[9]);
  const double A = O * O + K[0] * O + K[1];
  const double B = K[2] * O * O + K[3] * O + K[4];
  const double C = K[5] * O * O + K[6] * O + K[7];
  const double X = -B + std::sqrt(B * B - 4.0 * A * C);
  const double root = 2.0 * C / X;
  return 1e6 * (root * root) * (root * root);
}

double u_of_equation(IndexEquation equation) noexcept {
  return equation == IndexEquation::ShopFloor ? 1.5e-7 : 1.5e-8;
}

Result<RefractiveIndex> refractive_index(const Air& air, double vacuum_wavelength_m,
                                         IndexEquation equation) {
  const double t = air.temperature_K - kZeroCelsius_K;
  if (!within(t, 0.0, 50.0))
    return failure(ErrorCode::BadInput,
                   message("refractive index: air of ", t, " C; valid for 0 to 50"));
  if (!within(air.pressure_Pa, 50'000.0, 120'000.0))
    return failure(ErrorCode::BadInput, message("refractive index: air of ", air.pressure_Pa,
                                                " Pa; valid for 50000 to 120000"));
  if (!within(air.relative_humidity, 0.0, 1.05))
    return failure(ErrorCode::BadInput, message("refractive index: humidity of ",
                                                air.relative_humidity, "; valid for 0 to 1.05"));
  if (!within(air.co2_ppm, 0.0, 2000.0))
    return failure(ErrorCode::BadInput,
                   message("refractive index: ", air.co2_ppm, " ppm CO2; valid for 0 to 2000"));
  if (!within(vacuum_wavelength_m, 0.35e-6, 1.2e-6))
    return failure(ErrorCode::BadInput,
                   message("refractive index: wavelength of ", vacuum_wavelength_m,
                           " m; valid for 0.35e-6 to 1.2e-6"));
  const bool valid_u =
      within(air.u_temperature_K, 0.0, 50.0) && within(air.u_pressure_Pa, 0.0, 1e5) &&
      within(air.u_relative_humidity, 0.0, 1.0) && within(air.u_co2_ppm, 0.0, 2000.0);
  if (!valid_u)
    return failure(ErrorCode::BadInput,
                   "refractive index: an uncertainty of the air is negative, too large or not a "
                   "number");

  const auto part = [&](double Air::*quantity, double u) {
    return share(air, quantity, u, vacuum_wavelength_m, equation);
  };
  const double u_air =
      root_sum_of_squares(root_sum_of_squares(part(&Air::temperature_K, air.u_temperature_K),
                                              part(&Air::pressure_Pa, air.u_pressure_Pa)),
                          part(&Air::relative_humidity, air.u_relative_humidity));
  const double u_co2 = share_of_co2(air, vacuum_wavelength_m, equation);
  return RefractiveIndex{
      index_of(air, vacuum_wavelength_m, equation),
      root_sum_of_squares(root_sum_of_squares(u_air, u_co2), u_of_equation(equation))};
}

Air shop_floor_air() noexcept {
  constexpr Range kCelsius{15.0, 30.0}, kPascal{95'000.0, 105'000.0}, kHumidity{0.1, 0.9},
      kCo2_ppm{400.0, 1000.0};
  return {.temperature_K = kZeroCelsius_K + kCelsius.mean(),
          .pressure_Pa = kPascal.mean(),
          .relative_humidity = kHumidity.mean(),
          .co2_ppm = kCo2_ppm.mean(),
          .u_temperature_K = kCelsius.u(),
          .u_pressure_Pa = kPascal.u(),
          .u_relative_humidity = kHumidity.u(),
          .u_co2_ppm = kCo2_ppm.u()};
}

Result<double> u_of_assumed_air(const Air& assumed, double vacuum_wavelength_m,
                                IndexEquation equation) {
  const auto n_assumed = refractive_index(assumed, vacuum_wavelength_m, equation);
  const auto actual = refractive_index(shop_floor_air(), vacuum_wavelength_m, equation);
  if (!n_assumed || !actual) return tl::unexpected(n_assumed ? actual.error() : n_assumed.error());
  return root_sum_of_squares(actual->u_n, actual->n - n_assumed->n) / actual->n;
}

double distance_factor(double n_assumed, double n) noexcept {
  return n_assumed / n;
}

}  // namespace abbe::calib
