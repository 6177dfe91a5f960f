/**
 * @file sonde.h
 * The whole public interface of libsonde.
 */
#ifndef SONDE_SONDE_H
#define SONDE_SONDE_H

#include "sonde/base.h"
#include "sonde/base_json.h"
#include "sonde/geometry.h"
#include "sonde/sparse.h"
#include "sonde/tissue.h"
#include "sonde/tissue_anatomy.h"
#include "sonde/world.h"
#include "sonde/world_path.h"
#include "sonde/scene.h"
#include "sonde/fit.h"
#include "sonde/fit_confidence.h"
#include "sonde/fit_plausible.h"
#include "sonde/fit_sample.h"
#include "sonde/robot.h"
#include "sonde/identify.h"
#include "sonde/fit_report.h"
#include "sonde/anatomy.h"
#include "sonde/interior.h"
#include "sonde/interior_findings.h"
#include "sonde/echo.h"
#include "sonde/echo_validate.h"
#include "sonde/sweep_frames.h"
#include "sonde/sweep_volume.h"
#include "sonde/haptics.h"
#include "sonde/haptics_devices.h"
#include "sonde/haptics_gel.h"
#include "sonde/haptics_hand.h"
#include "sonde/haptics_local.h"
#include "sonde/haptics_render.h"
#include "sonde/files.h"
#include "sonde/exam.h"
#include "sonde/exam_journal.h"
#include "sonde/exam_player.h"
#include "sonde/trainer.h"
#include "sonde/trainer_protocol.h"
#include "sonde/trainer_judge.h"
#include "sonde/trainer_operator.h"
#include "sonde/trainer_log.h"
#include "sonde/trainer_report.h"
#include "sonde/stream.h"

#endif
