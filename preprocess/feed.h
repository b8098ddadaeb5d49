/* preprocess/feed.h - a spool as the input of a pass. */
#pragma once
#include "preprocess/pass.h"

/* Inserts all records of a sealed spool, in their order. The spool is empty afterwards, also after
 * a failure. */
bool prep_feed_spool(const prep_pass_env *env, prep_pass *pass, prep_spool *spool, mospt_err *err);
