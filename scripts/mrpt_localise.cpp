// Runs MRPT's Monte Carlo localisation over the scans of a file and prints the time of each update
// (move, weigh, resample) in ns, then of its weighing alone, then the last mean pose.
// Usage: mrpt_localise FILE; see scripts/bench_localise.py for the file's form.
#include <mrpt/bayes/CParticleFilter.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/slam/CMonteCarloLocalization2D.h>

#include <chrono>
#include <cstdio>
#include <fstream>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::ifstream file(argv[1], std::ios::binary);
  double head[10];  // scans, beams, aperture, range, cell, cols, rows, x, y, particles
  file.read(reinterpret_cast<char*>(head), sizeof head);
  const auto scans = static_cast<size_t>(head[0]), beams = static_cast<size_t>(head[1]);
  const auto cols = static_cast<int>(head[5]), rows = static_cast<int>(head[6]);

  auto map = mrpt::maps::COccupancyGridMap2D::Create();
  map->setSize(head[7], head[7] + cols * head[4], head[8], head[8] + rows * head[4], head[4]);
  std::vector<char> wall(static_cast<size_t>(rows) * cols);
  file.read(wall.data(), static_cast<std::streamsize>(wall.size()));
  for (int row = 0; row < rows; ++row)
    for (int col = 0; col < cols; ++col) map->setCell(col, row, wall[row * cols + col] ? 0.f : 1.f);
  auto& how = map->likelihoodOptions;
  how.likelihoodMethod = mrpt::maps::COccupancyGridMap2D::lmLikelihoodField_Thrun;
  how.LF_decimation = 1;
  how.LF_maxRange = static_cast<float>(head[3]);

  mrpt::slam::CMonteCarloLocalization2D particles(static_cast<size_t>(head[9]));
  particles.options.metricMap = map;
  mrpt::bayes::CParticleFilter filter;
  filter.m_options.PF_algorithm = mrpt::bayes::CParticleFilter::pfStandardProposal;
  filter.m_options.resamplingMethod = mrpt::bayes::CParticleFilter::prSystematic;
  filter.m_options.adaptiveSampleSize = false;
  filter.m_options.BETA = 1.0;  // resample at every update, as ours does

  mrpt::obs::CActionRobotMovement2D::TMotionModelOptions motion;
  motion.modelSelection = mrpt::obs::CActionRobotMovement2D::mmThrun;
  mrpt::poses::CPose2D last;
  std::vector<double> weighing;
  std::vector<float> ranges(beams);
  for (size_t i = 0; i < scans; ++i) {
    double pose[3];
    file.read(reinterpret_cast<char*>(pose), sizeof pose);
    file.read(reinterpret_cast<char*>(ranges.data()), sizeof(float) * beams);
    if (!file) return 1;
    const mrpt::poses::CPose2D now(pose[0], pose[1], pose[2]);
    if (i == 0) particles.resetDeterministic(now.asTPose(), static_cast<size_t>(head[9]));
    auto scan = mrpt::obs::CObservation2DRangeScan::Create();
    scan->aperture = head[2];
    scan->maxRange = head[3];
    scan->rightToLeft = true;
    scan->resizeScan(beams);
    for (size_t k = 0; k < beams; ++k) {
      scan->setScanRange(k, ranges[k]);
      scan->setScanRangeValidity(k, ranges[k] < head[3]);
    }
    mrpt::obs::CActionRobotMovement2D moved;
    moved.computeFromOdometry(i == 0 ? mrpt::poses::CPose2D() : now - last, motion);
    last = now;
    mrpt::obs::CActionCollection actions;
    actions.insert(moved);
    mrpt::obs::CSensoryFrame seen;
    seen.insert(scan);
    const auto from = std::chrono::steady_clock::now();
    filter.executeOn(particles, &actions, &seen);
    const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - from;
    std::printf("%.0f\n", took.count());
    const auto again = std::chrono::steady_clock::now();
    double sum = 0;
    for (const auto& particle : particles.m_particles)
      sum += map->computeObservationLikelihood(
          *scan, mrpt::poses::CPose3D(mrpt::poses::CPose2D(particle.d)));
    const std::chrono::duration<double, std::nano> weighed =
        std::chrono::steady_clock::now() - again;
    weighing.push_back(sum != 0 ? weighed.count() : 0);
  }
  for (const double ns : weighing) std::printf("%.0f\n", ns);
  mrpt::poses::CPose2D mean;
  particles.getMean(mean);
  std::printf("%.6f\n%.6f\n%.6f\n", mean.x(), mean.y(), mean.phi());
  return 0;
}
